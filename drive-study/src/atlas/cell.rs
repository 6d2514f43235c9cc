//! A cell of the atlas and the grid of all cells.

use drive_tools::error::{Result, bail};

/// The course of a run: the scenario of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Course {
    /// The load is applied once the speed is reached.
    Load,
    /// The speed reference changes under load.
    Speed,
    /// `Load`; then the resistance rises by 40 % within 10 s.
    Heating,
    /// `Load` with noise of the current sensors.
    Noise,
    /// `Noise` with offsets of the current sensors and a compensated dead time.
    Inverter,
    /// `Load` with a winding and a magnet that are cold from the start.
    Cold,
    /// `Load` with a winding and a magnet that are hot from the start.
    Hot,
    /// Torque control on an externally driven shaft.
    Torque,
    /// `Load` with current sensors of the wrong sign.
    Sign,
}

impl Course {
    /// All scenarios.
    pub const ALL: &'static [Self] = &[
        Self::Load,
        Self::Speed,
        Self::Heating,
        Self::Noise,
        Self::Inverter,
        Self::Cold,
        Self::Hot,
        Self::Torque,
        Self::Sign,
    ];

    /// Its name on the command line and in the CSV.
    pub fn name(self) -> &'static str {
        match self {
            Self::Load => "load",
            Self::Speed => "speed",
            Self::Heating => "heating",
            Self::Noise => "noise",
            Self::Inverter => "inverter",
            Self::Cold => "cold",
            Self::Hot => "hot",
            Self::Torque => "torque",
            Self::Sign => "sign",
        }
    }

    /// One sentence about it.
    pub fn title(self) -> &'static str {
        match self {
            Self::Load => "the load arrives at the speed",
            Self::Speed => "the speed reference comes under load",
            Self::Heating => "the load arrives, then R rises by 40 % in 10 s",
            Self::Noise => "the load arrives, noisy currents",
            Self::Inverter => "the load arrives, noise, offsets and a compensated dead time",
            Self::Cold => "the load arrives, winding and magnet at -30 degC from the start",
            Self::Hot => "the load arrives, winding and magnet at 130 degC from the start",
            Self::Torque => "torque control on a shaft that something else turns",
            Self::Sign => "the load arrives, current sensors of the wrong sign",
        }
    }
}

/// One run.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(non_snake_case, reason = "the symbols of the models")]
pub struct Cell {
    /// The scenario.
    pub scenario: Course,
    /// R^/R: the controller's resistance as a share of the (cold) machine's.
    pub R: f64,
    /// psi^/psi: the controller's magnet flux as a share of the machine's.
    pub psi: f64,
    /// Load as a share of the rated torque.
    pub load: f64,
    /// Speed reference as a share of the rated speed.
    pub speed: f64,
    /// Initial electrical angle (deg) of the rotor ahead of the estimate.
    pub theta: f64,
}

/// The values along each axis; the cells are all their combinations.
#[derive(Clone, Debug, PartialEq)]
#[expect(non_snake_case, reason = "the symbols of the models")]
pub struct Grid {
    /// The scenarios.
    pub scenarios: Vec<Course>,
    /// R^/R, > 0.
    pub R: Vec<f64>,
    /// psi^/psi, > 0.
    pub psi: Vec<f64>,
    /// Loads as shares of the rated torque.
    pub load: Vec<f64>,
    /// Speeds as shares of the rated speed.
    pub speed: Vec<f64>,
    /// Start angles in deg.
    pub theta: Vec<f64>,
}

impl Default for Grid {
    /// The 1100 cells of the scenario `Load`. Without noise, a cell and its mirror image (speed and load negated) have
    /// the same result, so speeds of one sign are enough.
    fn default() -> Self {
        Self {
            scenarios: vec![Course::Load],
            R: vec![0.5, 0.7, 0.8, 0.9, 0.95, 1.0, 1.05, 1.1, 1.2, 1.3, 1.5],
            psi: vec![0.8, 0.9, 1.0, 1.1, 1.2],
            load: vec![0.0, 0.5, -0.5, 1.0, -1.0],
            speed: vec![0.0, 0.01, 0.02, 0.05],
            theta: vec![0.0],
        }
    }
}

impl Grid {
    /// The first five scenarios, speeds of both signs, a magnet flux known to 5 %, and three start angles.
    pub fn full() -> Self {
        Self {
            scenarios: Course::ALL[..5].to_vec(),
            psi: vec![0.8, 0.9, 0.95, 1.0, 1.05, 1.1, 1.2],
            speed: vec![-0.05, -0.02, -0.01, 0.0, 0.01, 0.02, 0.05],
            theta: vec![-120.0, 0.0, 120.0],
            ..Self::default()
        }
    }

    /// The axes with their options and ranges.
    fn axes(&self) -> [(&'static str, &[f64], f64, f64); 5] {
        [
            ("--resistance", &self.R, 0.1, 10.0),
            ("--flux", &self.psi, 0.1, 10.0),
            ("--load", &self.load, -10.0, 10.0),
            ("--speed", &self.speed, -2.0, 2.0),
            ("--angle", &self.theta, -180.0, 180.0),
        ]
    }

    /// Every `every`-th cell, beginning with the first.
    ///
    /// # Errors
    /// An axis has no value or one outside its range, or `every` is 0.
    pub fn cells(&self, every: usize) -> Result<Vec<Cell>> {
        if self.scenarios.is_empty() {
            bail!("--scenario has no value: an atlas needs at least one; leave the option out for the default");
        }
        for (option, values, low, high) in self.axes() {
            if values.is_empty() {
                bail!("{option} has no value: an atlas needs at least one; leave the option out for the default");
            }
            if let Some(bad) = values.iter().find(|x| !(low..=high).contains(*x)) {
                bail!("{option} {bad}: must be within {low}..{high}; correct the value");
            }
        }
        if every == 0 {
            bail!("--every 0: must be 1 or more; 1 runs every cell");
        }
        let mut cells = Vec::new();
        for &scenario in &self.scenarios {
            for &theta in &self.theta {
                for &speed in &self.speed {
                    for &load in &self.load {
                        for &psi in &self.psi {
                            cells.extend(self.R.iter().map(|&R| Cell { scenario, R, psi, load, speed, theta }));
                        }
                    }
                }
            }
        }
        Ok(cells.into_iter().step_by(every).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_atlas_of_no_cells_is_refused() {
        let message = |grid: Grid, every| grid.cells(every).unwrap_err().to_string();
        let none = Grid { load: vec![], ..Grid::default() };
        assert!(message(none, 1).starts_with("--load has no value: an atlas needs at least one; leave the option out"));
        let none = Grid { scenarios: vec![], ..Grid::default() };
        assert!(message(none, 1).starts_with("--scenario has no value"));
        let negative = Grid { R: vec![1.0, -0.5], ..Grid::default() };
        assert_eq!(message(negative, 1), "--resistance -0.5: must be within 0.1..10; correct the value");
        let nothing = Grid { speed: vec![f64::NAN], ..Grid::default() };
        assert!(message(nothing, 1).starts_with("--speed NaN"));
        assert!(message(Grid::default(), 0).starts_with("--every 0: must be 1 or more"));
    }

    #[test]
    fn the_grid_is_the_product_of_its_axes() {
        assert_eq!(Grid::default().cells(1).unwrap().len(), 1100);
        assert_eq!(Grid::default().cells(7).unwrap().len(), 158);
        assert_eq!(Grid::full().cells(1).unwrap().len(), 11 * 7 * 5 * 7 * 5 * 3);
    }
}
