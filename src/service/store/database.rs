//! SQLite and PostgreSQL behind one small synchronous door: statements with `$1 … $n`, rows of plain values,
//! transactions.
//!
//! The same SQL serves both. `{now}` stands for the database's own clock in milliseconds since 1970 (workers' clocks
//! never matter), `{skip_locked}` for PostgreSQL's row locking; SQLite has one writer at a time and needs none.

use super::StoreError;
use std::path::Path;
use std::sync::{Mutex, MutexGuard};
use std::time::Duration;

/// A value of a statement or a row.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// 64-bit integer; times are milliseconds since 1970.
    Int(i64),
    /// Text.
    Text(String),
    /// Bytes.
    Blob(Vec<u8>),
}

impl From<i64> for Value {
    fn from(v: i64) -> Self {
        Value::Int(v)
    }
}
impl From<usize> for Value {
    fn from(v: usize) -> Self {
        Value::Int(i64::try_from(v).unwrap_or(i64::MAX))
    }
}
impl From<&str> for Value {
    fn from(v: &str) -> Self {
        Value::Text(v.into())
    }
}
impl From<String> for Value {
    fn from(v: String) -> Self {
        Value::Text(v)
    }
}
impl From<&String> for Value {
    fn from(v: &String) -> Self {
        Value::Text(v.clone())
    }
}
impl From<Vec<u8>> for Value {
    fn from(v: Vec<u8>) -> Self {
        Value::Blob(v)
    }
}

/// One row. Columns are never NULL.
#[derive(Clone, Debug)]
pub struct Row(Vec<Value>);

impl Row {
    /// Integer in a column; 0 where there is none.
    pub fn int(&self, column: usize) -> i64 {
        match self.0.get(column) {
            Some(Value::Int(v)) => *v,
            _ => 0,
        }
    }

    /// Text in a column; empty where there is none.
    pub fn text(&self, column: usize) -> String {
        match self.0.get(column) {
            Some(Value::Text(v)) => v.clone(),
            _ => String::new(),
        }
    }

    /// Bytes in a column; empty where there are none.
    pub fn blob(&self, column: usize) -> Vec<u8> {
        match self.0.get(column) {
            Some(Value::Blob(v)) => v.clone(),
            _ => Vec::new(),
        }
    }
}

/// Connections of one kind.
pub enum Database {
    /// One writer, any number of readers, in one file (WAL).
    Sqlite {
        /// The file.
        path: std::path::PathBuf,
        /// The only connection that writes.
        writer: Mutex<rusqlite::Connection>,
        /// Idle readers.
        readers: Mutex<Vec<rusqlite::Connection>>,
    },
    /// A pool of connections to a server.
    Postgres {
        /// How to connect.
        config: Box<postgres::Config>,
        /// Idle connections.
        idle: Mutex<Vec<postgres::Client>>,
    },
}

/// How often a transaction that lost against another one is tried again.
const MAX_TRIES: usize = 10;
/// Idle connections kept.
const MAX_IDLE: usize = 8;
/// How long a statement waits for the file's lock, which only another process can hold.
const BUSY: Duration = Duration::from_secs(20);

const SQLITE_NOW: &str = "CAST(unixepoch('subsec') * 1000 AS INTEGER)";
const POSTGRES_NOW: &str = "(extract(epoch from clock_timestamp()) * 1000)::bigint";

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // A panic while the lock was held leaves at worst a connection whose transaction was rolled back.
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

impl Database {
    /// Opens or makes the file.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn open_sqlite(path: &Path) -> Result<Self, StoreError> {
        let writer = open_file(path)?;
        Ok(Database::Sqlite { path: path.into(), writer: Mutex::new(writer), readers: Mutex::default() })
    }

    /// Connects to `postgres://…`.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn connect_postgres(url: &str) -> Result<Self, StoreError> {
        // The address may hold a password: it is not repeated in the message.
        let mut config: postgres::Config = url.parse().map_err(|_| StoreError::Address)?;
        config.application_name("lambdak");
        if config.get_connect_timeout().is_none() {
            config.connect_timeout(Duration::from_secs(10));
        }
        let client = config.connect(postgres::NoTls)?;
        Ok(Database::Postgres { config: Box::new(config), idle: Mutex::new(vec![client]) })
    }

    /// Whether several machines may share it.
    pub fn is_shared(&self) -> bool {
        matches!(self, Database::Postgres { .. })
    }

    /// Rows of a query, outside any transaction.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn read(&self, sql: &str, parameters: &[Value]) -> Result<Vec<Row>, StoreError> {
        match self {
            Database::Sqlite { path, readers, .. } => {
                let taken = lock(readers).pop();
                let connection = match taken {
                    Some(c) => c,
                    None => open_file(path)?,
                };
                let rows = sqlite_query(&connection, sql, parameters);
                let mut idle = lock(readers);
                if rows.is_ok() && idle.len() < MAX_IDLE {
                    idle.push(connection);
                }
                rows
            }
            Database::Postgres { .. } => self.with_client(|client| postgres_query(client, sql, parameters)),
        }
    }

    /// Runs `work` in a transaction; it is run again when another transaction was in the way, so it must have no
    /// effects outside the database.
    ///
    /// # Errors
    /// What `work` returns, or [`StoreError`]; nothing is kept then.
    pub fn transact<T>(&self, work: &dyn Fn(&mut Transaction) -> Result<T, StoreError>) -> Result<T, StoreError> {
        match self {
            Database::Sqlite { writer, .. } => {
                let mut connection = lock(writer);
                let inner = connection.transaction_with_behavior(rusqlite::TransactionBehavior::Immediate)?;
                let mut transaction = Transaction::Sqlite(inner);
                let out = work(&mut transaction)?;
                if let Transaction::Sqlite(inner) = transaction {
                    inner.commit()?;
                }
                Ok(out)
            }
            Database::Postgres { .. } => {
                let mut tries = 0;
                loop {
                    tries += 1;
                    let attempt = self.with_client(|client| {
                        let mut transaction = Transaction::Postgres(client.transaction()?);
                        let out = work(&mut transaction)?;
                        if let Transaction::Postgres(inner) = transaction {
                            inner.commit()?;
                        }
                        Ok(out)
                    });
                    match attempt {
                        Err(error) if error.is_conflict() && tries < MAX_TRIES => {
                            std::thread::sleep(Duration::from_millis(3 * tries as u64));
                        }
                        other => return other,
                    }
                }
            }
        }
    }

    fn with_client<T>(
        &self,
        work: impl FnOnce(&mut postgres::Client) -> Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        let Database::Postgres { config, idle } = self else { return Err(StoreError::Address) };
        let taken = lock(idle).pop();
        let mut client = match taken {
            Some(client) if !client.is_closed() => client,
            _ => config.connect(postgres::NoTls)?,
        };
        let out = work(&mut client);
        let mut idle = lock(idle);
        if !client.is_closed() && idle.len() < MAX_IDLE {
            idle.push(client);
        }
        out
    }
}

/// An open transaction; dropped without commit it is rolled back.
pub enum Transaction<'a> {
    /// In the file.
    Sqlite(rusqlite::Transaction<'a>),
    /// On the server.
    Postgres(postgres::Transaction<'a>),
}

impl Transaction<'_> {
    /// Number of rows that a statement changed.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn execute(&mut self, sql: &str, parameters: &[Value]) -> Result<u64, StoreError> {
        match self {
            Transaction::Sqlite(t) => {
                let mut statement = t.prepare_cached(&for_sqlite(sql))?;
                Ok(statement.execute(rusqlite::params_from_iter(parameters.iter().map(sqlite_value)))? as u64)
            }
            Transaction::Postgres(t) => Ok(t.execute(&for_postgres(sql), &postgres_parameters(parameters))?),
        }
    }

    /// Rows of a query or of a statement with RETURNING.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn query(&mut self, sql: &str, parameters: &[Value]) -> Result<Vec<Row>, StoreError> {
        match self {
            Transaction::Sqlite(t) => sqlite_query(t, sql, parameters),
            Transaction::Postgres(t) => postgres_query(t, sql, parameters),
        }
    }

    /// Statements without parameters, for the schema.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn batch(&mut self, sql: &str) -> Result<(), StoreError> {
        match self {
            Transaction::Sqlite(t) => Ok(t.execute_batch(sql)?),
            Transaction::Postgres(t) => Ok(t.batch_execute(&sql.replace("BLOB", "BYTEA"))?),
        }
    }
}

fn open_file(path: &Path) -> Result<rusqlite::Connection, StoreError> {
    let connection = rusqlite::Connection::open(path)?;
    connection.busy_timeout(BUSY)?;
    connection.execute_batch("PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL; PRAGMA foreign_keys = ON;")?;
    Ok(connection)
}

fn for_sqlite(sql: &str) -> String {
    sql.replace('$', "?").replace("{now}", SQLITE_NOW).replace("{skip_locked}", "")
}

fn for_postgres(sql: &str) -> String {
    sql.replace("{now}", POSTGRES_NOW).replace("{skip_locked}", "FOR UPDATE OF t SKIP LOCKED")
}

fn sqlite_value(value: &Value) -> rusqlite::types::Value {
    match value {
        Value::Int(v) => rusqlite::types::Value::Integer(*v),
        Value::Text(v) => rusqlite::types::Value::Text(v.clone()),
        Value::Blob(v) => rusqlite::types::Value::Blob(v.clone()),
    }
}

fn sqlite_query(connection: &rusqlite::Connection, sql: &str, parameters: &[Value]) -> Result<Vec<Row>, StoreError> {
    let mut statement = connection.prepare_cached(&for_sqlite(sql))?;
    let columns = statement.column_count();
    let mut rows = statement.query(rusqlite::params_from_iter(parameters.iter().map(sqlite_value)))?;
    let mut out = Vec::new();
    while let Some(row) = rows.next()? {
        let mut values = Vec::with_capacity(columns);
        for column in 0..columns {
            values.push(match row.get_ref(column)? {
                rusqlite::types::ValueRef::Null => Value::Int(0),
                rusqlite::types::ValueRef::Integer(v) => Value::Int(v),
                rusqlite::types::ValueRef::Real(v) => Value::Int(v as i64),
                rusqlite::types::ValueRef::Text(v) => Value::Text(String::from_utf8_lossy(v).into_owned()),
                rusqlite::types::ValueRef::Blob(v) => Value::Blob(v.to_vec()),
            });
        }
        out.push(Row(values));
    }
    Ok(out)
}

fn postgres_parameters(parameters: &[Value]) -> Vec<&(dyn postgres::types::ToSql + Sync)> {
    parameters
        .iter()
        .map(|value| match value {
            Value::Int(v) => v as &(dyn postgres::types::ToSql + Sync),
            Value::Text(v) => v,
            Value::Blob(v) => v,
        })
        .collect()
}

fn postgres_query(
    client: &mut impl postgres::GenericClient,
    sql: &str,
    parameters: &[Value],
) -> Result<Vec<Row>, StoreError> {
    use postgres::types::Type;
    let rows = client.query(&for_postgres(sql), &postgres_parameters(parameters))?;
    let mut out = Vec::with_capacity(rows.len());
    for row in rows {
        let mut values = Vec::with_capacity(row.len());
        for (column, description) in row.columns().iter().enumerate() {
            values.push(match *description.type_() {
                Type::INT8 => Value::Int(row.try_get::<_, Option<i64>>(column)?.unwrap_or(0)),
                Type::INT4 => Value::Int(row.try_get::<_, Option<i32>>(column)?.unwrap_or(0).into()),
                Type::BYTEA => Value::Blob(row.try_get::<_, Option<Vec<u8>>>(column)?.unwrap_or_default()),
                _ => Value::Text(row.try_get::<_, Option<String>>(column)?.unwrap_or_default()),
            });
        }
        out.push(Row(values));
    }
    Ok(out)
}
