//! Parameter files of Bruker ParaVision: JCAMP-DX with `##$NAME=value` entries.

use super::error::ScannerError;
use crate::file::{ReadingMemory, read_text_limited};
use std::fs;
use std::path::{Path, PathBuf};

/// Largest parameter file, bytes.
const MAX_BYTES: u64 = 64 << 20;

/// The entries of a parameter file.
pub(super) struct Parameters {
    path: PathBuf,
    text: String,
}

impl Parameters {
    /// Reads a file into memory that stays taken.
    ///
    /// # Errors
    /// [`ScannerError::File`], [`ScannerError::Memory`].
    pub(super) fn read(path: &Path, memory: &ReadingMemory) -> Result<Parameters, ScannerError> {
        let fail = |source| ScannerError::File { path: path.into(), source };
        let num_bytes = fs::metadata(path).map_err(|e| fail(e.into()))?.len().min(MAX_BYTES);
        memory.take("a parameter file", num_bytes)?;
        let text = read_text_limited(path, num_bytes).map_err(fail)?;
        Ok(Parameters { path: path.into(), text })
    }

    /// What stands behind an entry's equals sign, without the sizes of an array and without comments.
    fn value(&self, name: &str) -> Option<String> {
        let mut lines = self.text.lines();
        let mut value = loop {
            let line = lines.next()?;
            let entry = line.strip_prefix("##$").and_then(|entry| entry.strip_prefix(name));
            if let Some(rest) = entry.and_then(|rest| rest.trim_start().strip_prefix('=')) {
                break rest.trim().to_string();
            }
        };
        for line in lines.take_while(|line| !line.starts_with("##")) {
            if !line.starts_with("$$") {
                value.push(' ');
                value += line.trim();
            }
        }
        // Sizes are whole numbers in brackets, with the array's content behind them.
        if let Some((sizes, rest)) = value.strip_prefix('(').and_then(|v| v.split_once(')'))
            && !rest.trim().is_empty()
            && sizes.split(',').all(|size| size.trim().parse::<u64>().is_ok())
        {
            return Some(rest.trim().to_string());
        }
        Some(value.trim().to_string())
    }

    /// An error about an entry.
    pub(super) fn fault(&self, name: &str, found: impl Into<String>, requirement: &'static str) -> ScannerError {
        let found: String = found.into();
        let found = if found.is_empty() { "empty".into() } else { found.chars().take(80).collect() };
        ScannerError::Header { path: self.path.clone(), entry: name.into(), found, requirement }
    }

    /// A word or a text, without its angle brackets; `None` where the entry is missing.
    pub(super) fn word(&self, name: &str) -> Option<String> {
        let value = self.value(name)?;
        let text = value.strip_prefix('<').and_then(|v| v.split('>').next()).unwrap_or(&value);
        Some(text.trim().chars().take(80).collect())
    }

    /// The words of a list.
    pub(super) fn words(&self, name: &str) -> Vec<String> {
        let value = self.value(name).unwrap_or_default();
        let strip = |word: &str| word.trim_matches(|c: char| c == '<' || c == '>').to_string();
        value.split_whitespace().take(64).map(strip).collect()
    }

    /// The numbers of a list. Equal ones in a row may be written `@count*(number)`; the memory of them all is taken
    /// before they are.
    ///
    /// # Errors
    /// [`ScannerError::Header`] where it is missing or holds other than finite numbers; [`ScannerError::Memory`].
    pub(super) fn numbers(&self, name: &str, memory: &ReadingMemory) -> Result<Vec<f64>, ScannerError> {
        const NUMBERS: &str = "a list of finite numbers";
        let value = self.value(name).ok_or_else(|| self.fault(name, "missing", NUMBERS))?;
        let finite = |text: &str| text.parse().ok().filter(|x: &f64| x.is_finite());
        let mut numbers = Vec::new();
        for word in value.split_whitespace() {
            let (count, number) = match word.strip_prefix('@').and_then(|w| w.split_once("*(")) {
                Some((count, number)) => (count.parse::<u64>().ok(), finite(number.trim_end_matches(')'))),
                None => (Some(1), finite(word)),
            };
            let (Some(count), Some(number)) = (count, number) else {
                return Err(self.fault(name, word, NUMBERS));
            };
            // A list that grows holds its old place beside the new one.
            memory.take_values::<[f64; 2]>("the numbers of a parameter file", count)?;
            let more = usize::try_from(count).map_err(|_| self.fault(name, word, NUMBERS))?;
            numbers.resize(numbers.len() + more, number);
        }
        Ok(numbers)
    }

    /// The groups in brackets of a list, each with its fields; none where the entry is missing.
    pub(super) fn groups(&self, name: &str) -> Vec<Vec<String>> {
        let value = self.value(name).unwrap_or_default();
        let fields = |group: &str| group.split(',').map(|f| f.trim().to_string()).collect();
        value.split('(').skip(1).take(64).filter_map(|g| g.split_once(')')).map(|(group, _)| fields(group)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::MemoryLimit;

    fn parameters(text: &str) -> Parameters {
        Parameters { path: "visu_pars".into(), text: text.into() }
    }

    #[test]
    fn entries_are_read_as_paravision_writes_them() {
        let memory = MemoryLimit::body(1000).begin();
        let p = parameters(
            "##TITLE=Parameter List, ParaVision 6.0.1\n$$ a remark\n##$VisuCoreSize=( 2 )\n64 32\n\
             ##$VisuCoreWordType=_16BIT_SGN_INT\n##$VisuCorePosition=( 2, 3 )\n1 2 3 4\n$$ within\n5 -6.5e1\n\
             ##$Slope=( 5 )\n@4*(0.5) 2\n##$VisuAcquisitionProtocol=( 65 )\n<PC flow (x)>\n\
             ##$VisuFGOrderDesc=( 2 )\n(3, <FG_SLICE>, <>, 0, 2) (4, <FG_MOVIE>, <a b>, 2, 0)\n##END=\n",
        );
        assert_eq!(p.numbers("VisuCoreSize", &memory).unwrap(), [64.0, 32.0]);
        assert_eq!(p.numbers("VisuCorePosition", &memory).unwrap(), [1.0, 2.0, 3.0, 4.0, 5.0, -65.0]);
        assert_eq!(p.numbers("Slope", &memory).unwrap(), [0.5, 0.5, 0.5, 0.5, 2.0]);
        assert_eq!(p.word("VisuCoreWordType").as_deref(), Some("_16BIT_SGN_INT"));
        assert_eq!(p.word("VisuAcquisitionProtocol").as_deref(), Some("PC flow (x)"));
        let groups = p.groups("VisuFGOrderDesc");
        assert_eq!(groups[0][..2], ["3".to_string(), "<FG_SLICE>".to_string()]);
        assert_eq!(groups.len(), 2);
        // The beginning of a name is not the name.
        assert!(p.word("VisuCore").is_none());
        assert!(matches!(p.numbers("VisuCoreWordType", &memory), Err(ScannerError::Header { .. })));
        assert!(matches!(p.numbers("None", &memory), Err(ScannerError::Header { .. })));
    }

    /// A few characters that promise exabytes.
    #[test]
    fn repeated_numbers_take_their_memory_first() {
        let memory = MemoryLimit::body(1000).begin();
        let read = |text: &str| parameters(&format!("##$Slope=( 9 )\n{text}\n")).numbers("Slope", &memory);
        assert!(matches!(read("@9999999999999999*(1)"), Err(ScannerError::Memory(_))));
        assert!(matches!(read("@99999999999999999999999999*(1)"), Err(ScannerError::Header { .. })));
        assert!(matches!(read("@3*(nan)"), Err(ScannerError::Header { .. })));
    }
}
