//! Items that every kind of report uses: an experiment's rows in, tables and figures out.

pub(crate) use super::config::{OneOrMore, report};
pub(crate) use super::data::Rows;
pub(crate) use super::output::{Output, panel};
pub(crate) use crate::Error;
pub(crate) use figures::{Axis, Layer, Marks, Panel, Unit};
pub(crate) use serde::Serialize;
