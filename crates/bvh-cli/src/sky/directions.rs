//! The directions in which points look, and what each is worth: skies, positions of the sun, files.

use super::SkyArgs;
use crate::Error;
use crate::table::Table;
use bvh_core::{InvalidSky, Sky};
use bvh_scenes::files::read;
use glam::{DMat3, DVec3};
use humantime::parse_rfc3339_weak;
use solar_positioning::time::JulianDate;
use solar_positioning::{Location, SolarPositions, delta_t};
use std::num::NonZeroU32;
use std::path::Path;
use std::time::UNIX_EPOCH;

/// A day, by its name and the days from the Julian epoch to its beginning in universal time.
#[derive(Clone, Debug)]
pub struct Date {
    name: String,
    julian: f64,
}

const MINUTES: u32 = 24 * 60;

/// Directions in the axes of a scene, with the names of their columns of weights.
pub struct Looks {
    pub sky: Sky,
    pub columns: Vec<String>,
    /// Whether weights count by the cosine of a direction with the normal.
    pub by_cosine: bool,
}

pub fn built_in(text: &str) -> Result<Sky, String> {
    const MOST: u32 = 100_000;
    let uniform = || text.strip_prefix("uniform:")?.parse().ok();
    match text {
        "tregenza" => Ok(Sky::patches(NonZeroU32::MIN)),
        "reinhart" => Ok(Sky::patches(NonZeroU32::MIN.saturating_add(1))),
        _ => match uniform().filter(|count| (1..=MOST).contains(count)) {
            Some(count) => Ok(Sky::uniform(count)),
            None => Err(format!("accepted: tregenza, reinhart, or uniform:1 to uniform:{MOST}")),
        },
    }
}

pub fn place(text: &str) -> Result<Location, String> {
    let accepted = "accepted: degrees north and east as in 47.4,8.5";
    let (latitude, longitude) = text.split_once(',').ok_or(accepted)?;
    let [latitude, longitude] = [latitude, longitude].map(|number| number.trim().parse());
    match (latitude, longitude) {
        (Ok(latitude @ -90.0..=90.0), Ok(longitude @ -180.0..=180.0)) => {
            Ok(Location { latitude, longitude })
        }
        _ => Err(accepted.into()),
    }
}

pub fn date(text: &str) -> Result<Date, String> {
    let midnight = parse_rfc3339_weak(&format!("{text} 00:00:00")).ok();
    let since = midnight.and_then(|midnight| midnight.duration_since(UNIX_EPOCH).ok());
    let Some(since) = since else {
        let is_date = text.split('-').map(str::len).eq([4, 2, 2])
            && text.bytes().all(|byte| byte == b'-' || byte.is_ascii_digit());
        let fault = if is_date { "there is no such day since 1970; " } else { "" };
        return Err(format!("{fault}accepted: a date as in 2026-03-21"));
    };
    Ok(Date { name: text.to_owned(), julian: 2_440_587.5 + since.as_secs_f64() / 86_400.0 })
}

pub fn step(text: &str) -> Result<u32, String> {
    let step = text.parse().ok().filter(|step| *step > 0 && MINUTES.is_multiple_of(*step));
    step.ok_or_else(|| format!("accepted: whole minutes that divide {MINUTES}, a day"))
}

impl Looks {
    /// Makes the directions that the arguments specify; `axes` are east, north and up in the scene.
    pub fn new(args: &SkyArgs, axes: &DMat3) -> Result<Self, Error> {
        if let Some(path) = &args.directions {
            return Self::of_file(path);
        }
        let (directions, weights, columns) = match args.sun {
            Some(place) => sun(place, &args.dates, args.step)?,
            None => {
                let all = vec![u64::MAX; args.sky.words()];
                let free = args.sky.sums(&all, Some(DVec3::Z))[0];
                let weights = args.sky.weights().iter().map(|weight| weight / free).collect();
                (args.sky.directions().to_vec(), weights, vec!["sky_view_factor".into()])
            }
        };
        let directions = directions.into_iter().map(|direction| *axes * direction).collect();
        let sky = Sky::new(directions, [0.0, f64::INFINITY]);
        let sky = sky.and_then(|sky| sky.with_weights(weights));
        let sky = sky.map_err(|error| Error::Usage(error.to_string()))?;
        Ok(Self { sky, columns, by_cosine: args.sun.is_none() })
    }

    /// Reads directions with their weights, or the weight 1.
    fn of_file(path: &Path) -> Result<Self, Error> {
        let invalid = |message: String| Error::Usage(format!("{}: {message}", path.display()));
        let accepted = "x,y,z and any weights, as many in each line";
        let table = Table::<f64>::read(&read(path)?, |width| width >= 3, accepted);
        let table = table.map_err(invalid)?;
        table.check_names(&["x", "y", "z"]).map_err(invalid)?;
        if table.lines.is_empty() {
            return Err(invalid(format!("no directions; accepted: lines of {accepted}")));
        }
        let named = |error: InvalidSky| {
            let line = match error {
                InvalidSky::Direction { index, .. } => table.lines[index],
                InvalidSky::Weight(index, _) => table.lines[index / (table.width - 3)],
                _ => return invalid(error.to_string()),
            };
            invalid(format!("line {line}: {error}"))
        };
        let rows = || table.numbers.chunks_exact(table.width);
        let directions = rows().map(DVec3::from_slice).collect();
        let mut sky = Sky::new(directions, [0.0, f64::INFINITY]).map_err(named)?;
        let mut columns = vec!["free_directions".into()];
        if table.width > 3 {
            let weights = rows().flat_map(|row| &row[3..]).copied().collect();
            sky = sky.with_weights(weights).map_err(named)?;
            columns = match table.names.get(3..) {
                Some(names) => names.to_vec(),
                None => (1..table.width - 2).map(|number| format!("weight_{number}")).collect(),
            };
        }
        Ok(Self { sky, columns, by_cosine: false })
    }
}

/// Positions of the sun above the horizon, as in a sky of patches, the hours of each, and the names of
/// their columns: all days, and each if there are more.
type Sun = (Vec<DVec3>, Vec<f64>, Vec<String>);

/// Returns the sun in the middle of every step of days from midnight to midnight in the mean solar
/// time of a place, without refraction.
fn sun(place: Location, dates: &[Date], step: u32) -> Result<Sun, Error> {
    let invalid = |error| Error::Usage(format!("--sun, --dates: {error}"));
    let (mut directions, mut weights) = (Vec::new(), Vec::new());
    let mut columns = vec!["hours".to_owned()];
    if dates.len() > 1 {
        columns.extend(dates.iter().map(|date| date.name.clone()));
    }
    for (number, date) in dates.iter().enumerate() {
        let midnight = date.julian - place.longitude / 360.0;
        let since_2000 = (midnight - 2_451_544.5) / 365.2425;
        let late = delta_t::estimate(2000.0 + since_2000).map_err(invalid)?;
        for count in 0..MINUTES / step {
            let day = (f64::from(count) + 0.5) * f64::from(step) / f64::from(MINUTES);
            let time = JulianDate::new(midnight + day, late).map_err(invalid)?;
            let found = SolarPositions::new().at_from_julian(time, place, 0.0, None);
            let found = found.map_err(invalid)?;
            let (up, out) = libm::sincos(found.elevation_angle().to_radians());
            let (east, north) = libm::sincos(found.azimuth().to_radians());
            if up > 0.0 {
                directions.push(DVec3::new(out * east, out * north, up));
                let hours = f64::from(step) / 60.0;
                let of_column = |c: usize| if c == 0 || c == number + 1 { hours } else { 0.0 };
                weights.extend((0..columns.len()).map(of_column));
            }
        }
    }
    if directions.is_empty() {
        let accepted = "accepted: days on which it does";
        return Err(Error::Usage(format!("--dates: the sun does not rise there; {accepted}")));
    }
    Ok((directions, weights, columns))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sun_is_south_at_noon_and_as_high_and_long_as_the_season_has_it() {
        let place = place("47.4,8.5").unwrap();
        for (day, height, hours) in [("2026-03-20", 42.6, 12.0), ("2026-06-21", 66.0, 15.8)] {
            let (directions, weights, columns) = sun(place, &[date(day).unwrap()], 10).unwrap();
            assert_eq!(columns, ["hours"]);
            assert!((weights.iter().sum::<f64>() - hours).abs() < 0.2, "{weights:?}");
            let noon = directions.iter().max_by(|a, b| a.z.total_cmp(&b.z)).unwrap();
            assert!((noon.z.asin().to_degrees() - height).abs() < 0.2, "{noon}");
            assert!(noon.y < 0.0 && noon.x.abs() < 0.05, "{noon}");
            assert!(directions[0].x > 0.5, "the sun rises in the east");
        }
        let days = [date("2026-03-20").unwrap(), date("2026-06-21").unwrap()];
        let (_, weights, columns) = sun(place, &days, 60).unwrap();
        assert_eq!(columns, ["hours", "2026-03-20", "2026-06-21"]);
        assert!(weights.chunks(3).all(|hours| hours[0] == hours[1] + hours[2]));
        let night = [date("2026-12-21").unwrap()];
        assert!(sun(super::place("80,0").unwrap(), &night, 30).is_err());
        for (wrong, is_named) in [("2026-02-30", true), ("1969-12-31", true), ("30.2.2026", false)]
        {
            assert_eq!(date(wrong).unwrap_err().contains("no such day"), is_named, "{wrong}");
        }
    }
}
