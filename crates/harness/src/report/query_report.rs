//! A table of some rows of a CSV file, by the language of [`query`](super::query): selected,
//! grouped, aggregated, compared with a base, and drawn.

use super::config::check_file;
use super::data::distinct;
use super::output::table_bytes;
use super::paper::{PaperRow, ratios};
use super::prelude::*;
use super::query::{self, Conditions, Measure, QueryError, Row, number_in};
use super::query_figure::Drawing;
use crate::statistics::{median_interval, range};
use bvh_config::{Nested, OutOfRange, above};
use serde::Deserialize;

bvh_config::config! { serde;
    /// A table of some rows of a CSV file, and a figure of it.
    pub struct Config {
        /// The section of the paper or the topic that it belongs to.
        source: String;
        /// Heading.
        title: String;
        /// Name of the CSV file that is made, without its extension: letters, digits, `-` and `_`.
        /// A file with seconds needs a name that begins with `timing`.
        file: String;
        /// The CSV file whose rows are read.
        rows: String;
        /// Another CSV file. Each row is joined with all its rows that agree in the columns of
        /// both.
        join: String;
        /// Conditions on the rows, such as `family=inside, rays=max`.
        select: String = "*".into();
        /// Columns by which rows are grouped: the first columns of the table.
        by: Vec<String>, in OneOrMore;
        /// Conditions on the group that others are compared with, such as `method=greedy`. Groups
        /// agree with it in all columns that the conditions do not name.
        base: String;
        /// Pairs of labels of methods instead of a base: the second is compared with the first,
        /// which the column `against` names.
        pairs: Vec<[String; 2]>;
        /// The other columns of the table.
        columns: Vec<Column>, in Nested;
        /// Ratios within this relative distance of the paper's agree with it.
        tolerance: f64 = 0.05, in 0.0..=1.0;
        /// Why ours differs, where it does.
        reason: String;
        /// A figure of the table.
        #[serde(skip_serializing_if = "Option::is_none")]
        figure: Option<Drawing>, in Nested;
    }
    check Self::faults_of_queries;
}

bvh_config::config! { serde;
    /// A column of the table.
    pub struct Column {
        /// Its name.
        name: String;
        /// The quantity in words, for axes and sentences; by default the name with blanks.
        label: String;
        /// The aggregate, such as `median cost`, or `text` and a column in which all rows of a
        /// group agree.
        value: String;
        /// Which quotient with the base the column is, if any. Quotients of medians have further
        /// columns: the ends of an interval, which is between the extremes of all pairs of runs or,
        /// for paired runs, encloses the median with a probability of 95 %.
        #[serde(skip_serializing_if = "Option::is_none")]
        ratio: Option<Ratio>;
        /// Columns by which rows are paired with rows of the base, if quotients are computed pair
        /// by pair. A further column then holds the verdict of the interval.
        paired_by: Vec<String>;
        /// Lowest and highest quotient accepted; others are an error.
        #[serde(skip_serializing_if = "Option::is_none")]
        accepted: Option<[f64; 2]>, in 0.0..=1e300;
        /// The paper's numbers, for a further column. Quotients of a file without seconds are also
        /// compared with them in `paper.csv`.
        paper: Vec<OfPaper>, in Nested;
    }
}

bvh_config::config! { serde;
    /// A number of the paper.
    pub struct OfPaper {
        /// Conditions on the row of the table that it belongs to.
        row: String;
        /// The number.
        value: f64 = 1.0, in above(0.0);
        /// The paper's number for the base, which it is divided by.
        over: f64 = 1.0, in above(0.0);
    }
}

/// A quotient of a group and its base.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Ratio {
    /// The group's value over the base's.
    OverBase,
    /// The base's value over the group's.
    BaseOver,
}

impl Ratio {
    /// Returns the quotient; 1 for equal values, two zeros included.
    fn of(self, own: f64, base: f64) -> f64 {
        match self {
            _ if own == base => 1.0,
            Self::OverBase => own / base,
            Self::BaseOver => base / own,
        }
    }
}

/// Rows that agree in the columns of [`Config::by`].
struct Group<'r> {
    /// Their values in these columns, and the label that `against` names.
    key: Row,
    rows: Vec<&'r Row>,
    /// The rows that they are compared with.
    base: Vec<&'r Row>,
}

/// A quotient with the ends of its interval.
struct Compared {
    value: Option<f64>,
    interval: Option<(f64, f64)>,
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let read = |file: &str| query::read(&rows.folder.join(file));
        let mut selected = read(&self.rows)?;
        if !self.join.is_empty() {
            selected = query::join(&selected, &read(&self.join)?);
        }
        let path = rows.folder.join(&self.rows);
        let named =
            |error: QueryError| Error::Query { path: path.clone(), message: error.to_string() };
        let selected = query::select(selected, &self.select).map_err(named)?;
        let table = self.table(&selected).map_err(named)?;
        let mut output = Output::new(&self.source, &self.title);
        let columns = self.header();
        let bytes = table_bytes(&columns, &table)?;
        output.show_csv(&format!("{}:", self.title), &bytes, &columns.join(" "))?;
        output.csv.push((self.file.clone(), bytes));
        output.paper = self.compare(rows, &table).map_err(named)?;
        output.answer = ratios(&output.paper);
        output.reading = self.reading(&table);
        if let Some(figure) = &self.figure {
            let panels = figure.panels(rows, &table);
            output.add_figure(&self.file, &figure.caption, figure.per_row, panels);
        }
        Ok(output)
    }

    /// Returns the names of the table's columns.
    pub fn header(&self) -> Vec<String> {
        let mut names = self.by.clone();
        if !self.pairs.is_empty() {
            names.push("against".into());
        }
        for column in &self.columns {
            let name = &column.name;
            names.push(name.clone());
            if column.has_interval() {
                names.extend([format!("{name}_low"), format!("{name}_high")]);
            }
            if column.has_verdict() {
                names.push(format!("{name}_verdict"));
            }
            if !column.paper.is_empty() {
                names.push(format!("paper_{name}"));
            }
        }
        names
    }

    fn table(&self, rows: &[Row]) -> Result<Vec<Row>, QueryError> {
        let mut table = Vec::new();
        for group in self.groups(rows)? {
            let mut row = group.key.clone();
            for column in &self.columns {
                column.fill(&group, &mut row)?;
            }
            table.push(row);
        }
        Ok(table)
    }

    fn groups<'r>(&self, rows: &'r [Row]) -> Result<Vec<Group<'r>>, QueryError> {
        let by: Vec<&str> = self.by.iter().map(String::as_str).collect();
        let base = Conditions::parse(&self.base)?;
        let mut groups = Vec::new();
        for values in query::distinct(rows, &by)? {
            let mut key = Row::new();
            for (column, value) in by.iter().zip(&values) {
                key.insert((*column).to_owned(), value.clone());
            }
            let rows_of_group = query::group(rows, &by, &values);
            if self.pairs.is_empty() {
                let named: Vec<&str> = base.columns().collect();
                let base = if named.is_empty() { vec![] } else { find(rows, &key, &named, &base)? };
                groups.push(Group { key, rows: rows_of_group, base });
                continue;
            }
            for [first, second] in &self.pairs {
                if key.get("method") != Some(second) {
                    continue;
                }
                let is_first = Conditions::equal("method", first);
                let base = find(rows, &key, &["method"], &is_first)?;
                let mut key = key.clone();
                key.insert("against".into(), first.clone());
                groups.push(Group { key, rows: rows_of_group.clone(), base });
            }
        }
        Ok(groups)
    }

    /// Compares cells with the paper's numbers.
    fn compare(&self, rows: &Rows, table: &[Row]) -> Result<Vec<PaperRow>, QueryError> {
        let mut compared = Vec::new();
        if self.file.starts_with("timing") {
            return Ok(compared);
        }
        for column in &self.columns {
            for of_paper in &column.paper {
                let conditions = Conditions::parse(&of_paper.row)?;
                for row in table {
                    let Some(ours) = number_in(row, &column.name) else { continue };
                    if !conditions.are_met(row)? {
                        continue;
                    }
                    let scene = row
                        .get("scene")
                        .map_or_else(String::new, |scene| rows.shown(scene));
                    let quantity = format!("{}, {}", column.label(), self.subject(row));
                    let low = number_in(row, &format!("{}_low", column.name));
                    let high = number_in(row, &format!("{}_high", column.name));
                    let paper = of_paper.value / of_paper.over;
                    compared.push(
                        PaperRow::new(&self.source, scene, quantity, &self.reason).compare_ratios(
                            paper,
                            ours,
                            low.zip(high),
                            self.tolerance,
                        ),
                    );
                }
            }
        }
        Ok(compared)
    }

    /// Names a row of the table, without its scene, and the base that it is compared with.
    fn subject(&self, row: &Row) -> String {
        let names = self.by.iter().filter(|column| *column != "scene");
        let own: Vec<&str> = names.map(|column| row[column].as_str()).collect();
        let own = own.join(", ");
        match (row.get("against"), Conditions::parse(&self.base)) {
            (Some(against), _) => format!("{own} over {against}"),
            (None, Ok(base)) if !self.base.is_empty() => {
                format!("{own} over {}", base.texts().join(", "))
            }
            _ => own,
        }
    }

    /// Returns the span of the first quotient over scenes, for every other value of the key.
    fn reading(&self, table: &[Row]) -> String {
        let is_ratio = |column: &&Column| column.ratio.is_some();
        let Some(column) = self.columns.iter().find(is_ratio) else { return String::new() };
        let subjects: Vec<String> = table
            .iter()
            .map(|row| self.subject(row))
            .collect();
        let all = distinct(subjects.iter().map(String::as_str));
        let spans = each(all, |subject| {
            let rows_of_subject = table
                .iter()
                .zip(&subjects)
                .filter(|(_, of_row)| *of_row == subject);
            let values = rows_of_subject.filter_map(|(row, _)| number_in(row, &column.name));
            let (low, high) = range(values)?;
            // The base compared with itself says nothing.
            let (own, base) = subject
                .split_once(" over ")
                .unwrap_or((subject, ""));
            let is_base = own == base || own.starts_with(&format!("{base}, "));
            (!is_base).then(|| format!("{subject} {low:.3} to {high:.3}"))
        });
        format!("{}: {spans}.", capitalised(&column.label()))
    }

    fn faults_of_queries(&self) -> Vec<OutOfRange> {
        let mut faults = check_file(&self.file);
        let mut add = |key: String, result: Result<(), QueryError>| {
            if let Err(QueryError::Malformed { found, accepted, .. }) = result {
                faults.push(OutOfRange::new(key, format!("{found:?}"), accepted));
            }
        };
        add("select".into(), Conditions::parse(&self.select).map(|_| ()));
        add("base".into(), Conditions::parse(&self.base).map(|_| ()));
        for (index, column) in self.columns.iter().enumerate() {
            add(format!("columns[{index}].value"), column.check());
        }
        faults
    }
}

impl Column {
    fn check(&self) -> Result<(), QueryError> {
        match self.value.strip_prefix("text ") {
            Some(_) => Ok(()),
            None => Measure::parse(&self.value).map(|_| ()),
        }
    }

    fn label(&self) -> String {
        if self.label.is_empty() { self.name.replace('_', " ") } else { self.label.clone() }
    }

    fn has_interval(&self) -> bool {
        self.ratio.is_some() && self.value.starts_with("median ")
    }

    fn has_verdict(&self) -> bool {
        self.has_interval() && !self.paired_by.is_empty()
    }

    /// Adds the cells of this column to the row of a group.
    fn fill(&self, group: &Group, row: &mut Row) -> Result<(), QueryError> {
        if let Some(column) = self.value.strip_prefix("text ") {
            let text = query::only_text(&group.rows, column)?;
            row.insert(self.name.clone(), text.unwrap_or_default());
            return Ok(());
        }
        let measure = Measure::parse(&self.value)?;
        let Compared { value, interval } = match self.ratio {
            None => Compared { value: measure.of_rows(&group.rows)?, interval: None },
            Some(ratio) => self.quotient(group, &measure, ratio)?,
        };
        row.insert(self.name.clone(), text_of(value));
        if self.has_interval() {
            let (low, high) = interval.unzip();
            row.insert(format!("{}_low", self.name), text_of(low));
            row.insert(format!("{}_high", self.name), text_of(high));
        }
        if self.has_verdict() {
            row.insert(format!("{}_verdict", self.name), verdict(interval).into());
        }
        for of_paper in &self.paper {
            let paper = row
                .entry(format!("paper_{}", self.name))
                .or_default();
            let is_own = Conditions::parse(&of_paper.row)?.are_met(&group.key)?;
            if is_own {
                *paper = text_of(Some(of_paper.value / of_paper.over));
            }
        }
        Ok(())
    }

    fn quotient(
        &self,
        group: &Group,
        measure: &Measure,
        ratio: Ratio,
    ) -> Result<Compared, QueryError> {
        if self.paired_by.is_empty() {
            let own = measure.of_rows(&group.rows)?;
            let base = measure.of_rows(&group.base)?;
            let value = own
                .zip(base)
                .map(|(own, base)| ratio.of(own, base));
            self.check_accepted(group, value)?;
            let of_all = |rows: &[&Row]| {
                let values: Result<Vec<_>, _> = rows
                    .iter()
                    .map(|row| measure.of_row(row))
                    .collect();
                Ok(range(values?.into_iter().flatten()))
            };
            let ends = of_all(&group.rows)?.zip(of_all(&group.base)?);
            let interval = ends.map(|(own, base)| {
                let ends = [ratio.of(own.0, base.1), ratio.of(own.1, base.0)];
                (ends[0].min(ends[1]), ends[0].max(ends[1]))
            });
            return Ok(Compared { value, interval });
        }
        let mut quotients = Vec::new();
        for row in &group.rows {
            let is_partner = |other: &&&Row| {
                let mut columns = self.paired_by.iter();
                columns.all(|column| row.get(column) == other.get(column))
            };
            let Some(partner) = group.base.iter().find(is_partner) else { continue };
            let own = measure.of_row(row)?;
            let base = measure.of_row(partner)?;
            let quotient = own
                .zip(base)
                .map(|(own, base)| ratio.of(own, base));
            self.check_accepted(group, quotient)?;
            quotients.extend(quotient);
        }
        let value = measure.of_values(&quotients)?;
        // Fewer than six pairs enclose the median with a lower probability.
        let interval = median_interval(&quotients).filter(|_| quotients.len() >= 6);
        Ok(Compared { value, interval })
    }

    /// Rejects a quotient that is not accepted.
    fn check_accepted(&self, group: &Group, quotient: Option<f64>) -> Result<(), QueryError> {
        let Some(([low, high], quotient)) = self.accepted.zip(quotient) else { return Ok(()) };
        if (low..=high).contains(&quotient) {
            return Ok(());
        }
        let words: Vec<&str> = group.key.values().map(String::as_str).collect();
        Err(QueryError::NotAccepted {
            column: self.name.clone(),
            group: words.join(", "),
            found: quotient,
            accepted: format!("{low} to {high}"),
        })
    }
}

/// Returns the rows that agree with the key in all columns but the `free` ones, and that meet the
/// conditions.
fn find<'r>(
    rows: &'r [Row],
    key: &Row,
    free: &[&str],
    conditions: &Conditions,
) -> Result<Vec<&'r Row>, QueryError> {
    let mut found = Vec::new();
    for row in rows {
        let agrees = key
            .iter()
            .filter(|(column, _)| !free.contains(&column.as_str()))
            .all(|(column, text)| row.get(column) == Some(text));
        if agrees && conditions.are_met(row)? {
            found.push(row);
        }
    }
    Ok(found)
}

/// Returns the verdict of an interval of quotients.
fn verdict(interval: Option<(f64, f64)>) -> &'static str {
    match interval {
        Some((_, high)) if high < 1.0 => "lower",
        Some((low, _)) if low > 1.0 => "higher",
        _ => "inconclusive",
    }
}

fn text_of(number: Option<f64>) -> String {
    let Some(number) = number else { return String::new() };
    if number.fract() == 0.0 && number.abs() < 1e15 {
        return format!("{number:.0}");
    }
    format!("{number:?}")
}

fn capitalised(text: &str) -> String {
    let mut characters = text.chars();
    let first = characters
        .next()
        .map(|first| first.to_uppercase().to_string());
    first.unwrap_or_default() + characters.as_str()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// Makes the report of a spec's table over two files, in which `b` costs less than `a` and less
    /// so with every repetition.
    fn made(config: &str) -> Result<Output, String> {
        let folder = tempfile::tempdir().unwrap();
        let mut costs = String::from("scene,method,repetition,cost\n");
        let mut seconds = String::from("scene,method,repetition,seconds\n");
        for repetition in 0..6 {
            for (method, cost) in [("a", 10.0), ("b", 5.0 + 0.5 * f64::from(repetition))] {
                costs += &format!("s,{method},{repetition},{cost}\n");
                seconds += &format!("s,{method},{repetition},{}\n", 2.0 * cost);
            }
        }
        fs::write(folder.path().join("costs.csv"), costs).unwrap();
        fs::write(folder.path().join("timing.csv"), seconds).unwrap();
        let common = "file = 'x'\nrows = 'costs.csv'\nby = ['scene', 'method']\n";
        let config: Config = toml::from_str(&format!("{common}{config}")).unwrap();
        let rows = Rows { folder: folder.path().to_owned(), ..Rows::default() };
        config
            .write(&rows)
            .map_err(|error| error.to_string())
    }

    fn csv(output: &Output) -> &str {
        std::str::from_utf8(&output.csv[0].1).unwrap()
    }

    #[test]
    fn quotients_of_paired_runs_have_an_interval_and_a_verdict() {
        let output = made(
            "base = 'method=a'\ncolumns = [{ name = 'r', value = 'median cost', ratio = 'over_base', paired_by = ['repetition'] }]",
        );
        let output = output.unwrap();
        let expected = "scene,method,r,r_low,r_high,r_verdict\n\
                        s,a,1,1,1,inconclusive\ns,b,0.625,0.5,0.75,lower\n";
        assert_eq!(csv(&output), expected);
        assert_eq!(output.reading, "R: b over a 0.625 to 0.625.");
    }

    #[test]
    fn quotients_of_medians_lie_between_those_of_all_pairs_of_runs() {
        let output = made(
            "join = 'timing.csv'\npairs = [['b', 'a']]\nreason = 'none'\ncolumns = [\
             { name = 'r', label = 'cost', value = 'median cost', ratio = 'base_over', paper = [{ row = 'scene=s', value = 5.0, over = 8.0 }] },\
             { name = 'rate', value = 'sum seconds / cost' }]",
        );
        let output = output.unwrap();
        let expected =
            "scene,method,against,r,r_low,r_high,paper_r,rate\ns,a,b,0.625,0.5,0.75,0.625,12\n";
        assert_eq!(csv(&output), expected);
        let [row] = &output.paper[..] else { panic!("one number of the paper") };
        assert_eq!((row.quantity.as_str(), row.ours_low), ("cost, a over b", Some(0.5)));
    }

    #[test]
    fn a_quotient_that_is_not_accepted_is_an_error_with_its_place() {
        let message = made(
            "base = 'method=a'\ncolumns = [{ name = 'r', value = 'max cost', ratio = 'over_base', accepted = [0.6, 1.0] }]",
        );
        assert_eq!(message.map(|_| ()), Ok(()));
        let message = made(
            "base = 'method=a'\ncolumns = [{ name = 'r', value = 'min cost', ratio = 'over_base', accepted = [0.6, 1.0] }]",
        );
        let message = message.unwrap_err();
        let end = "costs.csv: r of b, s is 0.5; accepted: 0.6 to 1";
        assert!(message.ends_with(end), "{message}");
    }
}
