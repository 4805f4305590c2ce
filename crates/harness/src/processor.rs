//! The processor that this program runs on, and the names that its results are filed under.

use std::sync::LazyLock;

/// A processor's name, and the numbers that distinguish models with the same name.
pub struct Processor {
    name: String,
    model: Option<[String; 2]>,
}

/// The processor that this program runs on.
pub static PROCESSOR: LazyLock<Processor> = LazyLock::new(|| {
    Processor::parse(&std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default())
});

impl Processor {
    /// Parses the contents of Linux's `/proc/cpuinfo`. Without a name there, the architecture is
    /// the name.
    fn parse(info: &str) -> Self {
        let name = value(info, "model name").unwrap_or_else(|| std::env::consts::ARCH.into());
        let family = value(info, "cpu family");
        let model = family.zip(value(info, "model")).map(|(family, model)| [family, model]);
        Self { name, model }
    }

    /// The name for people, for example `AMD EPYC (family 25, model 17)`.
    pub fn name(&self) -> String {
        match &self.model {
            Some([family, model]) => format!("{} (family {family}, model {model})", self.name),
            None => self.name.clone(),
        }
    }

    /// The name for folders, for example `amd-epyc-25-17`: lower-case letters and digits, with
    /// single hyphens between words.
    pub fn folder(&self) -> String {
        let words: Vec<&str> = [&self.name]
            .into_iter()
            .chain(self.model.iter().flatten())
            .flat_map(|words| words.split(|letter: char| !letter.is_ascii_alphanumeric()))
            .filter(|word| !word.is_empty())
            .collect();
        words.join("-").to_lowercase()
    }
}

/// Returns the first value of a key; every core repeats the same keys.
fn value(info: &str, key: &str) -> Option<String> {
    let (_, value) = info
        .lines()
        .filter_map(|line| line.split_once(':'))
        .find(|(name, _)| name.trim() == key)?;
    Some(value.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_with_one_name_have_separate_folders() {
        let cpuinfo = |model| {
            format!(
                "processor\t: 0\ncpu family\t: 6\nmodel\t\t: {model}\n\
                 model name\t: Intel(R) Xeon(R) CPU @ 2.70GHz\n"
            )
        };
        let older = Processor::parse(&cpuinfo(106));
        let newer = Processor::parse(&cpuinfo(143));
        assert_eq!(newer.name(), "Intel(R) Xeon(R) CPU @ 2.70GHz (family 6, model 143)");
        assert_eq!(newer.folder(), "intel-r-xeon-r-cpu-2-70ghz-6-143");
        assert_ne!(older.folder(), newer.folder());
    }

    #[test]
    fn a_processor_without_a_name_is_named_by_its_architecture() {
        assert_eq!(
            Processor::parse("Features : fp asimd").folder(),
            std::env::consts::ARCH.replace('_', "-")
        );
    }
}
