//! The request for a map: the grid, the voltages, the temperatures, and the number of verified points.

use crate::error::{Result, WithContext, bail};

/// 0 degC in K.
pub const ZERO_CELSIUS: f64 = 273.15;

/// The request for a map.
#[derive(Clone, Debug, PartialEq)]
#[expect(non_snake_case, reason = "the symbol of the temperature")]
pub struct Request {
    /// DC-link voltages in V; if empty, the motor file's voltage.
    pub u_dc: Vec<f64>,
    /// Temperatures of winding and magnet in degC; 20 if empty.
    pub T: Vec<f64>,
    /// Number of speeds and of torques.
    pub grid: (usize, usize),
    /// Points that are verified for each voltage and temperature.
    pub verify: usize,
}

impl Default for Request {
    fn default() -> Self {
        Self { u_dc: Vec::new(), T: Vec::new(), grid: (47, 41), verify: 5 }
    }
}

/// Maximum number of points along an axis.
const MOST: usize = 1001;

/// The grid of a text like `47x41`.
///
/// # Errors
/// The text is not a grid, or the grid has too few or too many points.
pub fn grid(text: &str) -> Result<(usize, usize)> {
    let allowed = || {
        format!(
            "--grid {text}: write SPEEDSxTORQUES, for example 47x41: 2 to {MOST} speeds and an odd number of torques from 3 to {MOST}, \
             half of them for each sign"
        )
    };
    let (speeds, torques) = text.split_once('x').with_context(allowed)?;
    let (speeds, torques): (usize, usize) =
        (speeds.trim().parse().ok().with_context(allowed)?, torques.trim().parse().ok().with_context(allowed)?);
    if !(2..=MOST).contains(&speeds) || !(3..=MOST).contains(&torques) || torques.is_multiple_of(2) {
        bail!("{}", allowed());
    }
    Ok((speeds, torques))
}

/// Maximum number of voltages, of temperatures, and of verified points.
const MOST_VALUES: usize = 100;

impl Request {
    /// Checks the values.
    ///
    /// # Errors
    /// The option, its value, and the allowed values.
    pub fn check(&self) -> Result<()> {
        for &u_dc in &self.u_dc {
            if !(u_dc > 0.0 && u_dc <= 1e4) {
                bail!("--u-dc {u_dc}: must be greater than 0 V and at most 10000 V; correct the value");
            }
        }
        for &T in &self.T {
            if !(T > -ZERO_CELSIUS && T <= 1000.0) {
                bail!("--T {T}: must be above absolute zero, -273.15 degC, and at most 1000 degC; correct the value");
            }
        }
        for (option, count) in [("--u-dc", self.u_dc.len()), ("--T", self.T.len()), ("--verify", self.verify)] {
            if count > MOST_VALUES {
                bail!("{option}: {count} are too many; at most {MOST_VALUES}");
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_has_points_of_both_signs() {
        assert_eq!(grid("47x41").unwrap(), (47, 41));
        assert_eq!(grid(" 2 x 3").unwrap(), (2, 3));
        for text in ["", "47", "0x41", "47x0", "1x41", "47x40", "47x-1", "1e3x41", "2000x41", "axb"] {
            let error = grid(text).unwrap_err().to_string();
            assert!(error.starts_with(&format!("--grid {text}: ")) && error.contains("for example 47x41"), "{error}");
        }
    }

    #[test]
    fn values_are_physical() {
        assert!(Request::default().check().is_ok());
        let with = |u_dc: &[f64], T: &[f64]| Request { u_dc: u_dc.into(), T: T.into(), ..Request::default() }.check();
        assert!(with(&[300.0, 400.0], &[-40.0, 120.0]).is_ok());
        for (u_dc, T, message) in [
            (-300.0, 20.0, "--u-dc -300: must be greater than 0 V"),
            (f64::NAN, 20.0, "--u-dc NaN: must be"),
            (300.0, -300.0, "--T -300: must be above absolute zero, -273.15 degC"),
        ] {
            let error = with(&[u_dc], &[T]).unwrap_err().to_string();
            assert!(error.contains(message), "{error}");
        }
    }
}
