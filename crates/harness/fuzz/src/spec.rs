//! Specs of arbitrary bytes.

use harness::spec::{Experiment, Name, Overrides};
use std::path::Path;

/// Parses the bytes as a spec. Checks that the error names the file, or that the resolved spec
/// reads back as itself.
pub fn spec(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let path = Path::new("spec.toml");
    for quick in [false, true] {
        let overrides = Overrides { quick, ..Default::default() };
        match Experiment::parse(path, text, &overrides) {
            Ok(experiment) => {
                let mut expected = Experiment { name: Name::default(), quick: false, ..experiment };
                let resolved = toml::to_string(&expected).unwrap();
                let read = Experiment::parse(path, &resolved, &Overrides::default());
                expected.name = Name::try_from("spec".to_owned()).unwrap();
                assert_eq!(read.unwrap(), expected, "{resolved}");
            }
            Err(error) => {
                assert_eq!(error.exit_code(), 2);
                assert!(error.to_string().starts_with("spec.toml: "), "{error}");
            }
        }
    }
}
