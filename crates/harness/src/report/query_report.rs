//! A table of some rows of a CSV file, by the language of [`query`]: selected,
//! grouped, aggregated, compared with a base, and drawn.

use super::config::{accept, check_file};
use super::output::table_bytes;
use super::paper::PaperRow;
use super::prelude::*;
use super::query::{self, Conditions, QueryError, Row, number_in};
use super::query_column::{Column, Group};
use super::query_measure::Measure;
use crate::rows::{Row as _, TrialRow};
use bvh_config::{Nested, OutOfRange};

report! {
    /// A table of some rows of a CSV file.
    pub struct Config {
        /// Name of the CSV file that is made, without its extension: letters, digits, `-` and `_`.
        /// A file with seconds needs a name that begins with `timing`.
        file: String;
        /// The CSV file whose rows are read: of the experiment's runs, or of a report before this
        /// one.
        rows: String;
        /// Another CSV file. Each row is joined with all its rows that agree in the columns
        /// `join_by`.
        join: String;
        /// Columns; by default all that both files have. Another column of both files is called
        /// by the name of the second file, without extension, a dot and its own.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        join_by: Vec<String>;
        /// Conditions on the rows of the second file.
        #[serde(skip_serializing_if = "String::is_empty")]
        join_select: String;
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
    }
    check Self::check_queries;
}

impl Config {
    pub(super) fn write(&self, rows: &Rows) -> Result<Output, Error> {
        let path = rows.folder.join(&self.rows);
        let named =
            |error: QueryError| Error::Query { path: path.clone(), message: error.to_string() };
        let mut selected = rows.read_file(&self.rows)?;
        if !self.join.is_empty() {
            let others = query::select(rows.read_file(&self.join)?, &self.join_select);
            let name = self.join.trim_end_matches(".csv");
            selected = others
                .and_then(|others| query::join(&selected, name, &others, &self.join_by))
                .map_err(named)?;
        }
        let selected = query::select(selected, &self.select).map_err(named)?;
        let table = self.table(&selected).map_err(named)?;
        let mut output = Output::default();
        output.csv.push((self.file.clone(), table_bytes(&table)?));
        output.paper = self.compare(rows, &table).map_err(named)?;
        Ok(output)
    }

    /// Returns the labels of the methods whose single trials the table is of.
    pub(super) fn trial_methods(&self) -> Vec<String> {
        if self.rows != TrialRow::FILE {
            return vec![];
        }
        let select = Conditions::parse(&self.select);
        select.map_or(vec![], |conditions| conditions.texts_of("method").to_vec())
    }

    fn table(&self, rows: &[Row]) -> Result<Vec<Row>, QueryError> {
        let row = |group: Group| {
            let mut row = group.key.clone();
            self.columns.iter().try_for_each(|column| column.fill(&group, &mut row)).map(|()| row)
        };
        self.groups(rows)?.into_iter().map(row).collect()
    }

    fn groups<'r>(&self, rows: &'r [Row]) -> Result<Vec<Group<'r>>, QueryError> {
        let by: Vec<&str> = self.by.iter().map(String::as_str).collect();
        let base = Conditions::parse(&self.base)?;
        let mut bases = Vec::new();
        for row in rows.iter().filter(|_| !self.base.is_empty()) {
            bases.extend(base.are_met(row)?.then_some(row));
        }
        if bases.is_empty() && !self.base.is_empty() {
            return Err(QueryError::NoRow(self.base.clone()));
        }
        let named: Vec<&str> = base.columns().collect();
        let mut groups = Vec::new();
        for (values, rows_of_group) in query::grouped(rows, &by)? {
            let names = by.iter().map(|column| (*column).to_owned());
            let key: Row = names.zip(values).collect();
            if self.pairs.is_empty() {
                let base = bases.iter().copied().filter(|row| agree(row, &key, &named)).collect();
                groups.push(Group { key, rows: rows_of_group, base });
                continue;
            }
            for [first, second] in &self.pairs {
                if key.get("method") != Some(second) {
                    continue;
                }
                let is_base =
                    |row: &&Row| row.get("method") == Some(first) && agree(row, &key, &["method"]);
                let base = rows.iter().filter(is_base).collect();
                let against = ("against".to_owned(), first.clone());
                let key = key.clone().into_iter().chain([against]).collect();
                groups.push(Group { key, rows: rows_of_group.clone(), base });
            }
        }
        Ok(groups)
    }

    fn compare(&self, rows: &Rows, table: &[Row]) -> Result<Vec<PaperRow>, QueryError> {
        let mut compared = Vec::new();
        // `paper.csv` must have the same bytes on every machine, which seconds have not.
        if self.file.starts_with("timing") {
            return Ok(compared);
        }
        for column in &self.columns {
            for of_paper in &column.paper {
                let conditions = Conditions::parse(&of_paper.row)?;
                let paper = of_paper.value / of_paper.over;
                let mut found = Vec::new();
                for row in table {
                    let is_own = conditions.are_met(row)?;
                    let number = |end: &str| number_in(row, &format!("{}{end}", column.name));
                    let ours = number("").filter(|_| is_own);
                    found.extend(ours.map(|ours| (row, ours, number("_low").zip(number("_high")))));
                }
                if of_paper.readings {
                    let distance = |ours: f64| (ours / paper).ln().abs();
                    found.sort_by(|a, b| distance(a.1).total_cmp(&distance(b.1)));
                    found.truncate(1);
                }
                for (row, ours, interval) in found {
                    let scene = row.get("scene").map_or(String::new(), |scene| rows.shown(scene));
                    let subject = self.subject(row);
                    let of = if of_paper.readings { "the closest reading" } else { &subject };
                    let quantity = format!("{}, {of}", column.label());
                    let quantity = quantity.trim_end_matches(", ");
                    let row = PaperRow::new(scene, quantity);
                    compared.push(match &*of_paper.says {
                        "" if of_paper.readings => {
                            row.compare_reading(paper, ours, &subject, self.tolerance)
                        }
                        "" => row.compare_ratios(paper, ours, interval, self.tolerance),
                        says => row.compare_words(says, ours, interval, of_paper.from),
                    });
                }
            }
        }
        Ok(compared)
    }

    /// Names a row of the table without its scene, and the base that it is compared with.
    fn subject(&self, row: &Row) -> String {
        let names = self.by.iter().filter(|column| !column.starts_with("scene"));
        let own = names.map(|column| row[column].as_str()).collect::<Vec<_>>().join(", ");
        let base =
            Conditions::parse(&self.base).map_or(String::new(), |base| base.texts().join(", "));
        match row.get("against").unwrap_or(&base).as_str() {
            "" => own,
            base => format!("{own} over {base}"),
        }
    }
}

impl Config {
    /// Rejects a file that would replace rows of runs, and conditions and values that cannot be
    /// read. Columns are known only when the rows are.
    fn check_queries(&self) -> Result<(), OutOfRange> {
        check_file("", &self.file)?;
        if self.rows == TrialRow::FILE && self.trial_methods().is_empty() {
            let accepted = "`method=LABEL or LABEL`, the methods whose trials are kept";
            return Err(OutOfRange::new("select", format!("{:?}", self.select), accepted));
        }
        accept("select", Conditions::parse(&self.select))?;
        accept("join_select", Conditions::parse(&self.join_select))?;
        accept("base", Conditions::parse(&self.base))?;
        for (index, column) in self.columns.iter().enumerate() {
            accept(&format!("columns[{index}].value"), Measure::parse(&column.value))?;
            for (at, of_paper) in column.paper.iter().enumerate() {
                let key = format!("columns[{index}].paper[{at}].row");
                accept(&key, Conditions::parse(&of_paper.row))?;
            }
        }
        Ok(())
    }
}

/// Whether a row has the texts of the key in all columns but the `free` ones.
fn agree(row: &Row, key: &Row, free: &[&str]) -> bool {
    let mut bound = key.iter().filter(|(column, _)| !free.contains(&column.as_str()));
    bound.all(|(column, text)| row.get(column) == Some(text))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::paper::Verdict;
    use bvh_config::Check;
    use figures::Scale;

    /// Makes the report of a spec's table over two earlier ones, in which `b` costs less than `a`
    /// and less so with every repetition.
    fn made(config: &str) -> Result<Output, String> {
        let mut costs = String::from("scene,method,repetition,cost\n");
        let mut seconds = String::from("scene,method,repetition,seconds\n");
        for repetition in 0..6 {
            for (method, cost) in [("a", 10.0), ("b", 5.0 + 0.5 * f64::from(repetition))] {
                costs += &format!("s,{method},{repetition},{cost}\n");
                seconds += &format!("s,{method},{repetition},{}\n", 2.0 * cost);
            }
        }
        let common = "file = 'x'\nrows = 'costs.csv'\nby = ['scene', 'method']\n";
        let config: Config = toml::from_str(&format!("{common}{config}")).unwrap();
        let made = [("costs", costs), ("timing", seconds)];
        let made = made.map(|(name, text)| (name.to_owned(), text.into_bytes())).into();
        let rows = Rows { made, ..Rows::default() };
        let output = config.write(&rows).and_then(|output| config.finish(output, &rows));
        output.map_err(|error| error.to_string())
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
    }

    #[test]
    fn a_figure_has_the_names_of_people() {
        let output = made(
            "columns = [{ name = 'r', value = 'median cost' }]\n\
             figure = { x = 'r', y = 'scene', series = ['method'], names = { s = 'a hill' } }",
        );
        let (_, figure) = output.unwrap().figures.remove(0);
        let panels = figure.panels.into_iter();
        let panels: Vec<_> = panels.map(|panel| (panel.y.scale, panel.layers.len())).collect();
        assert_eq!(panels, [(Scale::Rows(vec!["a hill".into()], 26.0), 4)]);
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
    fn several_readings_of_a_number_of_the_paper_are_one_row_by_the_closest() {
        let readings = |paper| {
            let paper =
                format!("paper = [{{ row = 'scene=s', value = {paper}, readings = true }}]");
            let columns = format!("columns = [{{ name = 'r', value = 'min cost', {paper} }}]");
            let [row] = &made(&columns).unwrap().paper[..] else { panic!("one row") };
            (row.ours.clone(), row.verdict)
        };
        // A reading that comes close may still not be the paper's.
        assert_eq!(readings(5.1), ("5.0000, by b".to_owned(), Verdict::Inconclusive));
        assert_eq!(readings(14.0), ("10.0000, by a".to_owned(), Verdict::Differs));
    }

    #[test]
    fn quotients_of_means_have_the_interval_of_both_errors() {
        let columns = "base = 'method=a'\nselect = 'repetition=4'\ncolumns = [{ name = 'r', \
                       value = 'only cost', ratio = 'over_base', \
                       error = ['repetition', 'repetition'] }]";
        // Half the width is 3.182 (Student's, of four) times 0.7 and the hypotenuse of 4/10 and 4/7.
        let output = made(columns).unwrap();
        assert!(csv(&output).contains("\ns,b,0.7,-0.853"), "{}", csv(&output));
        assert!(csv(&output).ends_with(",inconclusive\n"), "{}", csv(&output));
    }

    #[test]
    fn words_of_the_paper_hold_from_a_number_on() {
        let verdict = |from| {
            let paper = format!("paper = [{{ row = 'method=b', says = 'most', from = {from} }}]");
            let columns = format!("columns = [{{ name = 'r', value = 'mean cost < 7', {paper} }}]");
            let output = made(&columns).unwrap();
            assert!(csv(&output).ends_with("s,b,0.6666666666666666\n"), "{}", csv(&output));
            output.paper[0].verdict
        };
        assert_eq!((verdict(0.5), verdict(0.7)), (Verdict::Agrees, Verdict::Differs));
    }

    #[test]
    fn files_of_runs_and_queries_that_cannot_be_read_are_rejected_by_key() {
        for (change, key) in [
            // Runs would be lost.
            ("file = 'runs'", "file"),
            ("rows = 'trial_costs.csv'", "select"),
            ("select = 'method'", "select"),
            ("base = 'work<much'", "base"),
            ("join_select = 'method'", "join_select"),
            ("columns = [{ name = 'c', value = 'modal cost' }]", "columns[0].value"),
            (
                "columns = [{ value = 'max cost', paper = [{ row = 'escher' }] }]",
                "columns[0].paper[0].row",
            ),
            ("figure = { select = 'scene' }", "figure.select"),
        ] {
            let mut config: toml::Table =
                "file = 'x'\nrows = 'runs.csv'\nby = ['scene']".parse().unwrap();
            config.extend(change.parse::<toml::Table>().unwrap());
            let config: Config = config.try_into().unwrap();
            assert_eq!(config.check().unwrap_err().key, key, "{change}");
        }
    }

    #[test]
    fn files_columns_and_rows_that_are_not_there_are_named_when_they_are_read() {
        for (change, message) in [
            ("join = 'missing.csv'", "missing.csv"),
            ("base = 'method=A'", "no row meets \"method=A\""),
            ("columns = [{ name = 'c', value = 'max work' }]", "no column \"work\""),
            (
                "columns = [{ name = 'c', value = 'max cost ^ cost' }]",
                "\"cost ^ cost\" is no value",
            ),
            ("columns = [{ name = 'scene', value = 'max cost' }]", "\"scene\" is no name"),
            ("figure = { x = 'cost', y = 'scene' }", "figure: there is no column \"cost\""),
            (
                "columns = [{ name = 'c', value = 'max cost', paper = [{ row = 'k=1', value = 1.0 }] }]",
                "no column \"k\"",
            ),
        ] {
            let error = made(change).unwrap_err();
            assert!(error.contains(message), "{error}");
        }
    }
}
