//! The processor that this program runs on, by the name that its results are kept under.

use std::sync::LazyLock;

/// A processor's name, and the numbers that tell models of one name apart.
pub struct Processor {
    name: String,
    model: Option<[String; 2]>,
}

/// The processor that this program runs on.
pub static PROCESSOR: LazyLock<Processor> = LazyLock::new(|| {
    Processor::parse(&std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default())
});

impl Processor {
    /// Reads the text in which Linux describes processors. Of other texts the architecture remains.
    fn parse(info: &str) -> Self {
        let value = |key: &str| {
            let lines = info
                .lines()
                .filter_map(|line| line.split_once(':'));
            let mut found = lines.filter(|(name, _)| name.trim() == key);
            found
                .next()
                .map(|(_, value)| value.trim().to_owned())
        };
        let name = value("model name").unwrap_or_else(|| std::env::consts::ARCH.into());
        let model = value("cpu family")
            .zip(value("model"))
            .map(|(family, model)| [family, model]);
        Self { name, model }
    }

    /// The name for people, for example `AMD EPYC (family 25, model 17)`.
    pub fn name(&self) -> String {
        match &self.model {
            Some([family, model]) => format!("{} (family {family}, model {model})", self.name),
            None => self.name.clone(),
        }
    }

    /// The name for folders, for example `amd-epyc-25-17`: lower-case letters and digits with single hyphens between.
    pub fn folder(&self) -> String {
        let model = self.model.iter().flatten().map(String::as_str);
        let words: Vec<&str> = std::iter::once(self.name.as_str())
            .chain(model)
            .collect();
        let lower = words.join(" ").to_lowercase();
        let parts = lower.split(|letter: char| !letter.is_ascii_alphanumeric());
        parts
            .filter(|part| !part.is_empty())
            .collect::<Vec<_>>()
            .join("-")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_of_one_name_have_folders_of_their_own() {
        let text = |model| {
            format!(
                "processor\t: 0\ncpu family\t: 6\nmodel\t\t: {model}\nmodel name\t: Intel(R) Xeon(R) CPU @ 2.70GHz\n"
            )
        };
        let older = Processor::parse(&text(106));
        let newer = Processor::parse(&text(143));
        assert_eq!(newer.name(), "Intel(R) Xeon(R) CPU @ 2.70GHz (family 6, model 143)");
        assert_eq!(newer.folder(), "intel-r-xeon-r-cpu-2-70ghz-6-143");
        assert_ne!(older.folder(), newer.folder());
    }

    #[test]
    fn a_machine_that_does_not_say_has_its_architecture() {
        assert_eq!(
            Processor::parse("Features : fp asimd").folder(),
            std::env::consts::ARCH.replace('_', "-")
        );
    }
}
