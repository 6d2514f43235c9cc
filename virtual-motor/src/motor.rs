//! The virtual motor: `PmsmPlant` with the time of a firmware, its duty cycles or gate signals, and its sensors.
//!
//! An advance is a communication step of the FMU: the plant with constant inputs from the present time to the given one. Duty
//! cycles are the FMU's voltage references on the legs, `u_x = (d_x - 1/2) u_dc`; with `inverter.zero_sequence` = None, which is
//! the start value here, the carrier gives each leg its duty cycle back.

use crate::error::{Error, ErrorCode, Result};
use crate::sensing::{AdcCounts, AdcSetup, EncoderCount, EncoderSetup, Sensors, TerminalVoltages};
use crate::variables;
use drive::PmsmPlant;
use drive::frame::Phases;
use drive::plant::iron::Iron;
use drive::plant::pwm::{InverterMode, ZeroSequence};
use drive::plant::switched::bridge::Command;
use fmu_core::{Block, Elapsed, Fault, Interface, Model, Step};

/// Maximum current in A of the start values' machine.
const REFERENCE_CURRENT: f64 = 7.5;

/// A motor with inverter and sensors. Its start values are those of `PmsmPlant`, without a zero sequence and with the switched
/// inverter, or with the average one if the machine has iron loss, which the switched one does not model.
#[derive(Clone)]
pub struct VirtualMotor {
    block: Block<PmsmPlant>,
    elapsed: Elapsed,
    time: f64,
    /// The first advance has taken place.
    begun: bool,
    /// A value was set that state and outputs do not reflect yet.
    dirty: bool,
    sensors: Sensors,
}

impl Default for VirtualMotor {
    fn default() -> Self {
        Self::with(Block::default(), REFERENCE_CURRENT)
    }
}

impl VirtualMotor {
    /// A motor with this plant, of this maximum current (A): switched, unless it has iron loss, and without a zero sequence.
    pub(crate) fn with(mut block: Block<PmsmPlant>, i_max: f64) -> Self {
        let par = &mut block.model.parameters;
        (par.inverter.pwm.mode, par.inverter.pwm.zero_sequence) = (Self::mode(&par.iron), ZeroSequence::None);
        // The names are built once, so that no later call allocates them.
        variables::names();
        let sensors = Sensors::of(i_max, block.model.inputs.u_dc);
        Self { block, elapsed: Elapsed::ZERO, time: 0.0, begun: false, dirty: true, sensors }
    }

    /// Scales the converter to the link voltage; if no mode of the inverter `is_given`, iron loss determines it.
    pub(crate) fn settle_start_values(&mut self, is_given: bool) {
        self.sensors = Sensors::of(REFERENCE_CURRENT, self.block.model.inputs.u_dc);
        let par = &mut self.block.model.parameters;
        if !is_given {
            par.inverter.pwm.mode = Self::mode(&par.iron);
        }
    }

    /// The switched inverter excludes iron loss.
    fn mode(iron: &Iron) -> InverterMode {
        if iron.is_none() { InverterMode::Switched } else { InverterMode::Average }
    }

    /// Sets the variable with this number, see [`find`](variables::find): any input at any time, parameters before the first
    /// advance, a tunable parameter at any time. A Boolean is 0 or 1, an enumeration its number.
    ///
    /// # Errors
    /// Names the variable, its value and what is allowed.
    pub fn set(&mut self, variable: u32, value: f64) -> Result<()> {
        let is_parameter = variables::write(&mut self.block, variable, value, self.begun)?;
        self.dirty |= is_parameter || !self.begun;
        Ok(())
    }

    /// The value of the variable with this number, at the present time.
    ///
    /// # Errors
    /// No variable has this number.
    pub fn get(&mut self, variable: u32) -> Result<f64> {
        self.settle();
        variables::read(&mut self.block, variable)
    }

    /// The present time in s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Before the first advance, state and outputs follow the values that were set.
    fn settle(&mut self) {
        if self.dirty && !self.begun {
            self.block.initialize();
            self.dirty = false;
        }
    }

    /// Advances to the time `t` (s), while the carrier switches the legs with these `duties` (0 to 1), or with the gates off
    /// without `enable`. The carrier takes the duties over at its next extreme, as `inverter.update` states: at the present time,
    /// if it is one.
    ///
    /// # Errors
    /// Names the duty cycle or the time, its value and what is allowed; or the parameters contradict each other, or the motor has
    /// no state at this time. The motor has not changed.
    pub fn advance_duties(&mut self, t: f64, duties: [f64; 3], enable: bool) -> Result<()> {
        if let Some(x) = duties.iter().position(|d| !(0.0..=1.0).contains(d)) {
            return Err(Error::value(ErrorCode::BadValue, format_args!("duties[{x}]"), duties[x], "0 to 1"));
        }
        self.advance(t, |plant, step| {
            let [a, b, c] = duties.map(|d| (d - 0.5) * plant.inputs.u_dc);
            (plant.inputs.u, plant.inputs.enable) = (Phases { a, b, c }, enable);
            step.map_or(Ok(()), |step| plant.advance(step))
        })
    }

    /// Advances to the time `t` (s) with these gate signals: bit 0 is the upper gate of leg a, bit 1 its lower one, bits 2 and 3
    /// those of leg b, bits 4 and 5 those of leg c. The dead time is what the signals leave.
    ///
    /// # Errors
    /// Another bit is set, both gates of a leg are on, or `inverter.mode` is not Switched; otherwise those of
    /// [`advance_duties`](Self::advance_duties). The motor has not changed.
    pub fn advance_gates(&mut self, t: f64, gates: u32) -> Result<()> {
        if gates > 0x3f {
            return Err(Error::value(ErrorCode::BadValue, "gates", format_args!("{gates:#x}"), "0 to 0x3f"));
        }
        let mut commands = [Command::Off; 3];
        for (x, command) in commands.iter_mut().enumerate() {
            *command = match gates >> (2 * x) & 3 {
                0 => Command::Off,
                1 => Command::Upper,
                2 => Command::Lower,
                _ => {
                    let name = ["a", "b", "c"][x];
                    let allowed = format_args!("both gates of leg {name} are on, which short-circuits the link");
                    return Err(Error::value(ErrorCode::ShootThrough, "gates", format_args!("{gates:#04x}"), allowed));
                }
            };
        }
        if !self.block.model.parameters.is_switched() {
            return Err(needs_switched("gate signals"));
        }
        self.advance(t, |plant, step| {
            plant.inputs.enable = gates != 0;
            step.map_or(Ok(()), |step| plant.advance_gates(step, commands))
        })
    }

    fn advance(&mut self, t: f64, act: impl FnOnce(&mut PmsmPlant, Option<&Step>) -> Result<(), Fault>) -> Result<()> {
        // False for NaN, too.
        if !(t >= self.time && t.is_finite()) {
            let allowed = format_args!("a finite time from the present one, {} s, on", self.time);
            return Err(Error::value(ErrorCode::BadTime, "t", format_args!("{t} s"), allowed));
        }
        let before = self.block.model.checkpoint();
        let advanced = self.adopt().and_then(|()| {
            let step = Step { start: self.elapsed, h: t - self.time };
            let step = (step.h >= f64::MIN_POSITIVE).then_some(step);
            act(&mut self.block.model, step.as_ref()).map_err(|fault| Error::new(ErrorCode::Failed, fault))?;
            Ok(step.map_or(self.elapsed, |step| step.end()))
        });
        match advanced {
            Ok(end) => {
                self.block.model.output(end, &mut self.block.out);
                (self.elapsed, self.time, self.begun, self.dirty) = (end, t, true, false);
                Ok(())
            }
            Err(error) => {
                self.block.model.restore(before);
                Err(error)
            }
        }
    }

    /// Checks the parameters together, and applies them.
    fn adopt(&mut self) -> Result<()> {
        if !self.dirty && self.begun {
            return Ok(());
        }
        let model = &mut self.block.model;
        model.derive();
        let refused = |fault: Fault| Error::new(ErrorCode::Inconsistent, fault);
        model.validate().map_err(refused)?;
        model.validate_for(Interface::CoSimulation).map_err(refused)?;
        if !self.begun {
            self.block.initialize();
        }
        Ok(())
    }

    /// The channels of the converter.
    pub fn adc_setup(&self) -> AdcSetup {
        self.sensors.adc_setup()
    }

    /// Sets the channels of the converter.
    ///
    /// # Errors
    /// Names the field, its value and what is allowed.
    pub fn set_adc(&mut self, setup: AdcSetup) -> Result<()> {
        self.sensors.set_adc(setup)
    }

    /// Counts of the converter at the present time.
    ///
    /// # Errors
    /// Shunts need `inverter.mode` = 2 (Switched): the average inverter has no legs.
    pub fn adc(&mut self) -> Result<AdcCounts> {
        self.settle();
        let mut upper = [None; 3];
        if self.sensors.has_shunts() {
            let terminals = self.block.model.terminals();
            upper = terminals.ok_or_else(|| needs_switched("shunts"))?.upper;
        }
        let Phases { a, b, c } = self.block.out.i;
        Ok(self.sensors.counts([a, b, c], upper, self.block.model.inputs.u_dc))
    }

    /// The encoder.
    pub fn encoder_setup(&self) -> EncoderSetup {
        self.sensors.encoder_setup()
    }

    /// Sets the encoder.
    ///
    /// # Errors
    /// Names the field, its value and what is allowed.
    pub fn set_encoder(&mut self, setup: EncoderSetup) -> Result<()> {
        self.sensors.set_encoder(setup)
    }

    /// What the encoder shows at the present time.
    pub fn encoder(&mut self) -> EncoderCount {
        self.settle();
        self.sensors.encoder(self.block.out.angle)
    }

    /// Sets the electrical angle (rad) at which Hall sensor a rises.
    ///
    /// # Errors
    /// The angle is not finite.
    pub fn set_hall(&mut self, offset: f64) -> Result<()> {
        self.sensors.set_hall(offset)
    }

    /// The Hall sensors at the present time: bit 0 is sensor a, bit 1 sensor b, bit 2 sensor c.
    pub fn hall(&mut self) -> u32 {
        self.settle();
        self.sensors.hall(self.block.out.theta_e)
    }

    /// The terminals of the machine at the present time, floating ones included.
    ///
    /// # Errors
    /// `inverter.mode` is not Switched.
    pub fn terminals(&mut self) -> Result<TerminalVoltages> {
        self.settle();
        let terminals = self.block.model.terminals();
        terminals.map(|terminals| self.sensors.terminals(terminals)).ok_or_else(|| needs_switched("terminals"))
    }
}

#[cold]
fn needs_switched(what: &str) -> Error {
    let allowed = format_args!("{what} need 2 (Switched)");
    Error::value(ErrorCode::NeedsSwitched, "inverter.mode", "1 (Average)", allowed)
}
