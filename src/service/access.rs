//! Who may do what: tokens with roles and quotas, hashed at rest.

use super::problem::Problem;
use super::store::sha256_hex;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use utoipa::ToSchema;

/// What a token allows; each role includes those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Look at jobs and results.
    Read,
    /// Start, cancel and resume jobs, upload recordings.
    Submit,
    /// Everybody's jobs, metrics.
    Admin,
}

/// A token of the file.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Token {
    /// Name, for lists and quotas.
    pub name: String,
    /// What it allows.
    pub role: Role,
    /// SHA-256 of the token, hexadecimal. Tokens are 256 random bits, so no slow hash is needed.
    pub sha256: String,
    /// Most tasks queued or running at a time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_queued_tasks: Option<usize>,
    /// Most elements of a mesh.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_elements: Option<usize>,
    /// Most bytes of recordings kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_recordings_bytes: Option<u64>,
}

/// The file of tokens (`tokens/1`).
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TokenFile {
    /// Always `tokens/1`.
    pub schema: String,
    /// The tokens.
    pub tokens: Vec<Token>,
}

/// Why a file of tokens cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TokenError {
    /// Reading or writing failed.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It is not `tokens/1`.
    #[error("{}: {message}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        message: String,
    },
    /// The system gives no random numbers.
    #[error("the system gives no random numbers: {message}")]
    NoRandomness {
        /// Why.
        message: String,
    },
}

/// Who makes a request.
#[derive(Clone, Debug)]
pub struct Caller {
    /// Name of the token; `local` without tokens.
    pub name: String,
    /// Whose share of the service it takes: the token's, or the address's where there are no tokens.
    pub share: String,
    /// Role.
    pub role: Role,
    /// Quota of tasks.
    pub max_queued_tasks: Option<usize>,
    /// Quota of size.
    pub max_elements: Option<usize>,
    /// Quota of recordings.
    pub max_recordings_bytes: Option<u64>,
}

impl Caller {
    /// # Errors
    /// `forbidden` below `role`.
    pub fn require(&self, role: Role) -> Result<(), Problem> {
        if self.role >= role {
            return Ok(());
        }
        Err(Problem::new("forbidden", format!("the token {} has role {:?}; this needs {role:?}", self.name, self.role)))
    }
}

impl Caller {
    /// # Errors
    /// `forbidden` where somebody else's `what` is to be changed by no admin.
    pub fn require_owner(&self, owner: &str, what: &str) -> Result<(), Problem> {
        self.require(Role::Submit)?;
        if owner == self.name || self.role == Role::Admin {
            return Ok(());
        }
        Err(Problem::new("forbidden", format!("the {what} is {owner}'s; only {owner} or an admin may change it")))
    }
}

/// The tokens of a service; none means that everybody who reaches it (on this machine only) may do everything.
#[derive(Clone, Debug, Default)]
pub struct Access {
    tokens: Vec<Token>,
}

impl Access {
    /// Reads the file.
    ///
    /// # Errors
    /// [`TokenError`].
    pub fn read(path: &Path) -> Result<Access, TokenError> {
        let file = read_file(path)?;
        let fail = |message: String| TokenError::Content { path: path.into(), message };
        if file.tokens.is_empty() {
            return Err(fail("holds no token; make one with lambdak serve --add-token NAME:ROLE".into()));
        }
        for token in &file.tokens {
            if token.sha256.len() != 64 || !token.sha256.bytes().all(|b| b.is_ascii_hexdigit()) {
                return Err(fail(format!("sha256 of {} is not 64 hexadecimal digits", token.name)));
            }
        }
        Ok(Access { tokens: file.tokens })
    }

    /// Whether tokens are needed.
    pub fn is_closed(&self) -> bool {
        !self.tokens.is_empty()
    }

    /// Who sends this `Authorization` header.
    ///
    /// # Errors
    /// `unauthorized`.
    pub fn caller(&self, authorization: Option<&str>, address: &str) -> Result<Caller, Problem> {
        if !self.is_closed() {
            return Ok(Caller {
                name: "local".into(),
                share: address.into(),
                role: Role::Admin,
                max_queued_tasks: None,
                max_elements: None,
                max_recordings_bytes: None,
            });
        }
        let refuse = || Problem::new("unauthorized", "send the header Authorization: Bearer TOKEN");
        let unknown = || {
            let remedy = "it may be mistyped, replaced or removed; ask whoever runs the service for another one";
            Problem::new("unauthorized", format!("this token is none of the service's; {remedy}"))
        };
        let (scheme, secret) = authorization.and_then(|a| a.split_once(' ')).ok_or_else(refuse)?;
        if !scheme.eq_ignore_ascii_case("bearer") {
            return Err(refuse());
        }
        let hash = sha256_hex(secret.trim().as_bytes());
        // Hashes are compared without a data-dependent end; every token is looked at.
        let mut found = None;
        for token in &self.tokens {
            let difference =
                token.sha256.bytes().zip(hash.bytes()).fold(0, |d, (a, b)| d | (a.to_ascii_lowercase() ^ b));
            if difference == 0 {
                found = Some(token);
            }
        }
        let token = found.ok_or_else(unknown)?;
        Ok(Caller {
            name: token.name.clone(),
            share: format!("token {}", token.name),
            role: token.role,
            max_queued_tasks: token.max_queued_tasks,
            max_elements: token.max_elements,
            max_recordings_bytes: token.max_recordings_bytes,
        })
    }
}

fn read_file(path: &Path) -> Result<TokenFile, TokenError> {
    let text = std::fs::read_to_string(path).map_err(|source| TokenError::Io { path: path.into(), source })?;
    let fail = |message: String| TokenError::Content { path: path.into(), message };
    let file: TokenFile = serde_json::from_str(&text).map_err(|e| fail(e.to_string()))?;
    if file.schema == "tokens/1" { Ok(file) } else { Err(fail(format!("schema is {:?}, not tokens/1", file.schema))) }
}

/// Random bytes of the system, hexadecimal.
///
/// # Errors
/// [`TokenError::NoRandomness`].
pub fn random_hex<const BYTES: usize>() -> Result<String, TokenError> {
    let mut bytes = [0u8; BYTES];
    getrandom::fill(&mut bytes).map_err(|e| TokenError::NoRandomness { message: e.to_string() })?;
    Ok(bytes.iter().map(|b| format!("{b:02x}")).collect())
}

/// Adds a token to the file (made where there is none) and returns it; only its hash is kept.
///
/// # Errors
/// [`TokenError`].
pub fn add_token(path: &Path, name: &str, role: Role) -> Result<String, TokenError> {
    let mut file =
        if path.exists() { read_file(path)? } else { TokenFile { schema: "tokens/1".into(), tokens: Vec::new() } };
    let secret = format!("lk_{}", random_hex::<32>()?);
    file.tokens.retain(|t| t.name != name);
    file.tokens.push(Token {
        name: name.into(),
        role,
        sha256: sha256_hex(secret.as_bytes()),
        max_queued_tasks: None,
        max_elements: None,
        max_recordings_bytes: None,
    });
    let text = serde_json::to_string_pretty(&file).unwrap_or_default();
    let fail = |source| TokenError::Io { path: path.into(), source };
    std::fs::write(path, text + "\n").map_err(fail)?;
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o600)).map_err(fail)?;
    }
    Ok(secret)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_are_hashed_and_roles_ordered() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tokens.json");
        let secret = add_token(&path, "anna", Role::Submit).unwrap();
        assert!(!std::fs::read_to_string(&path).unwrap().contains(&secret));
        let access = Access::read(&path).unwrap();
        let caller = access.caller(Some(&format!("Bearer {secret}")), "").unwrap();
        assert_eq!((caller.name.as_str(), caller.role), ("anna", Role::Submit));
        assert!(caller.require(Role::Read).is_ok());
        assert_eq!(caller.require(Role::Admin).unwrap_err().status, 403);
        for forged in [None, Some("Bearer "), Some("Bearer lk_0"), Some("Basic x"), Some(secret.as_str())] {
            assert_eq!(access.caller(forged, "").unwrap_err().status, 401, "{forged:?}");
        }
    }
}
