//! The suite of stiff cases as a measurement.

use super::measurement::{Measurement, Work};
use crate::Error;
use crate::stress::Measure;
use bvh_search::Observer;

/// A measurement over the suite. It cannot be resumed.
pub(crate) struct Suite<'a>(pub &'a Measure);

impl Measurement for Suite<'_> {
    fn indivisible(&self) -> Option<&'static str> {
        Some("the suite of cases cannot be split; run it without --run")
    }

    fn measure(&self, work: &mut Work) -> Result<String, Error> {
        let Work { experiment, store, watch, .. } = work;
        let Measure { stability } = self.0;
        stability.execute(&experiment.scenes, &experiment.methods, store, &|| watch.cancelled())?;
        Ok(String::new())
    }
}
