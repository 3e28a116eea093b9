//! The cells of a text table as test machines write it: separator, decimal sign, lines before the header, units below
//! it.

use super::csv_error::CsvError;

/// Most rows that are read: a day at ten readings a second.
const MAX_ROWS: usize = 1_000_000;
/// Most lines before the header.
const MAX_PREAMBLE: usize = 500;

/// What stands in a cell without a number, beside dashes.
const NO_NUMBER: [&str; 5] = ["n/a", "na", "#n/a", "#nv", "null"];

/// What parts the cells of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Separator {
    Semicolon,
    Tab,
    Comma,
    Blanks,
}

impl Separator {
    /// All, in the order in which they are tried: a semicolon or a tab never stands inside a number.
    const ALL: [Separator; 4] = [Separator::Semicolon, Separator::Tab, Separator::Comma, Separator::Blanks];

    fn sign(self) -> Option<char> {
        match self {
            Separator::Semicolon => Some(';'),
            Separator::Tab => Some('\t'),
            Separator::Comma => Some(','),
            Separator::Blanks => None,
        }
    }

    /// The cells of a line; a separator inside quotation marks parts nothing.
    fn cells(self, line: &str) -> Vec<String> {
        let Some(sign) = self.sign() else {
            return line.split_whitespace().map(|c| c.trim_matches('"').to_string()).collect();
        };
        let mut cells = vec![String::new()];
        let mut is_quoted = false;
        for c in line.chars() {
            match c {
                '"' => is_quoted = !is_quoted,
                c if c == sign && !is_quoted => cells.push(String::new()),
                c => cells.last_mut().expect("there is a cell").push(c),
            }
        }
        cells.into_iter().map(|c| c.trim().to_string()).collect()
    }
}

/// A line of the file with its number, from 1.
type Line<'a> = (usize, &'a str);

/// A table of texts.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TextTable {
    /// Names of the columns as they stand in the header.
    pub names: Vec<String>,
    /// Units that a line below the header gives; empty where there is none.
    pub units: Vec<String>,
    /// Lines before the header.
    pub num_preamble: usize,
    /// Whether decimals follow a comma.
    pub has_decimal_comma: bool,
    /// Cells of each row, with the line's number.
    rows: Vec<(usize, Vec<String>)>,
}

/// Whether a cell is a number with a point or, where allowed, with a comma.
fn is_number(cell: &str, may_have_comma: bool) -> bool {
    cell.parse::<f64>().is_ok() || (may_have_comma && cell.replacen(',', ".", 1).parse::<f64>().is_ok())
}

impl TextTable {
    /// The table in `text`, whose header is the first line for which `is_header` holds.
    ///
    /// # Errors
    /// [`CsvError`]. Where no line is a header, the names are those of the line above the first numbers.
    pub fn read(text: &str, is_header: &dyn Fn(&[String]) -> bool) -> Result<TextTable, CsvError> {
        let all = text.trim_start_matches('\u{feff}').lines().enumerate().map(|(index, l)| (index + 1, l));
        let (comments, lines): (Vec<Line>, Vec<Line>) =
            all.filter(|(_, l)| !l.trim().is_empty()).partition(|(_, l)| l.trim_start().starts_with('#'));
        if lines.is_empty() {
            return Err(CsvError::Empty { what: "header" });
        }
        let separator_of = |line: &str| Separator::ALL.into_iter().find(|s| is_header(&s.cells(line)));
        for at in 0..lines.len().min(MAX_PREAMBLE) {
            if let Some(separator) = separator_of(lines[at].1) {
                return TextTable::below(&lines, at, separator);
            }
        }
        // Some programs write the header as a comment, the last one above the numbers.
        let above = comments.iter().rfind(|(line, _)| *line < lines[0].0);
        if let Some(header) =
            above.map(|&(line, comment)| (line, comment.trim_start().trim_start_matches('#').trim_start()))
            && let Some(separator) = separator_of(header.1)
        {
            return TextTable::below(&[&[header], &lines[..]].concat(), 0, separator);
        }
        // The line above the first numbers is what was meant: the caller says which column it does not find in it.
        let numbers = |cells: &[String]| cells.iter().filter(|c| is_number(c, true)).count();
        let most_cells = |line: &str| {
            let cells = |s: &Separator| s.cells(line).len();
            // The first of several that part alike.
            Separator::ALL.into_iter().rev().max_by_key(cells).unwrap_or(Separator::Comma)
        };
        let first = lines.iter().position(|(_, line)| numbers(&most_cells(line).cells(line)) >= 2).unwrap_or(1);
        let Some(mut at) = first.checked_sub(1) else { return Err(CsvError::Empty { what: "header" }) };
        let separator = most_cells(lines[at].1);
        let mut names = separator.cells(lines[at].1);
        if at > 0 && names.iter().any(|n| is_unit_cell(n)) {
            let above = separator.cells(lines[at - 1].1);
            if above.len() == names.len() {
                (at, names) = (at - 1, above);
            }
        }
        let without_rows =
            TextTable { names, units: Vec::new(), num_preamble: at, has_decimal_comma: false, rows: Vec::new() };
        // Columns that are asked for by their numbers need no names that are known.
        Ok(TextTable::below(&lines, at, separator).unwrap_or(without_rows))
    }

    /// The table whose header is line `at` of `lines`.
    fn below(lines: &[Line], at: usize, separator: Separator) -> Result<TextTable, CsvError> {
        let mut names = separator.cells(lines[at].1);
        while names.len() > 1 && names.last().is_some_and(String::is_empty) {
            names.pop();
        }
        // Some machines end each line with a separator.
        let cells_of = |line: &str| {
            let mut cells = separator.cells(line);
            while cells.len() > names.len() && cells.last().is_some_and(String::is_empty) {
                cells.pop();
            }
            cells
        };
        let mut rest = &lines[at + 1..];
        let may_have_comma = separator != Separator::Comma || rest.iter().any(|(_, l)| l.contains('"'));
        let mut units = Vec::new();
        if let Some((_, line)) = rest.first() {
            let cells = cells_of(line);
            let is_text = |c: &String| !is_number(c, may_have_comma);
            if cells.len() == names.len() && cells.iter().all(is_text) && cells.iter().any(|c| is_unit_cell(c)) {
                units = cells;
                rest = &rest[1..];
            }
        }
        if rest.len() > MAX_ROWS {
            return Err(CsvError::TooLong { limit: MAX_ROWS });
        }
        let mut rows = Vec::with_capacity(rest.len());
        for &(line, text) in rest {
            let cells = cells_of(text);
            if cells.len() != names.len() {
                return Err(CsvError::RowLength { line, found: cells.len(), expected: names.len() });
            }
            rows.push((line, cells));
        }
        let has_decimal_comma =
            may_have_comma && rows.iter().flat_map(|(_, cells)| cells).any(|c| c.contains(',') && is_number(c, true));
        Ok(TextTable { names, units, num_preamble: at, has_decimal_comma, rows })
    }

    /// The number of rows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// The number in a cell; NaN where it is empty or says that there is none.
    ///
    /// # Errors
    /// [`CsvError::NotANumber`].
    pub fn number(&self, row: usize, column: usize) -> Result<f64, CsvError> {
        let (line, cells) = &self.rows[row];
        let cell = cells[column].as_str();
        if cell.trim_matches('-').is_empty() || NO_NUMBER.iter().any(|text| cell.eq_ignore_ascii_case(text)) {
            return Ok(f64::NAN);
        }
        let refused = || CsvError::NotANumber { line: *line, text: cell.into() };
        if !self.has_decimal_comma {
            return cell.parse().map_err(|_| refused());
        }
        // A point beside decimal commas would part thousands, which the next program reads as a decimal point.
        if cell.contains('.') {
            return Err(refused());
        }
        cell.replacen(',', ".", 1).parse().map_err(|_| refused())
    }
}

/// Whether a cell below a name is a unit, with or without brackets.
fn is_unit_cell(cell: &str) -> bool {
    super::csv_unit::Unit::of(super::csv_unit::without_brackets(cell)).is_some()
}
