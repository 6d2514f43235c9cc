//! What a firmware reads: counts of the converter, of the encoder and of the Hall sensors, and voltages of the terminals.

use crate::error::{Error, ErrorCode, Result};
use drive::plant::sensors::adc::Adc;
use drive::plant::sensors::encoder::Encoder;
use drive::plant::sensors::hall::Hall;
use drive::plant::sensors::shunt;
use drive::plant::switched::terminals::Terminals;

/// Current sensors in the phases: [`AdcSetup::sensors`].
pub const PHASES: u32 = 0;
/// A shunt below each lower switch.
pub const LOW_SIDE: u32 = 1;
/// One shunt in the link.
pub const LINK: u32 = 2;

/// Channels of the converter: gains, offsets and the place of the current sensors.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct AdcSetup {
    /// Counts per A; negative with an inverting amplifier, not 0.
    pub current_gain: f64,
    /// Counts at 0 A.
    pub current_offset: f64,
    /// Counts per V, not 0.
    pub voltage_gain: f64,
    /// Counts at 0 V.
    pub voltage_offset: f64,
    /// Resolution in bits, 1 to 24.
    pub bits: u32,
    /// [`PHASES`], [`LOW_SIDE`] or [`LINK`].
    pub sensors: u32,
}

/// Counts of the converter at an instant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct AdcCounts {
    /// Currents of the phases a, b and c; with one shunt in the link, its current and two zeros.
    pub i: [u32; 3],
    /// DC-link voltage.
    pub u_dc: u32,
}

/// An incremental encoder.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct EncoderSetup {
    /// Mechanical angle at which count 0 begins, in rad.
    pub offset: f64,
    /// Edges of both tracks per turn, four times the lines: a multiple of 4 from 4 to 2^24.
    pub counts: u32,
}

/// What the encoder shows at an instant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct EncoderCount {
    /// Count within the turn, from 0 to `counts` - 1.
    pub count: u32,
    /// Whole turns.
    pub turns: i32,
    /// Bit 0: track A, bit 1: track B, bit 2: index.
    pub bits: u32,
}

/// The terminals of the machine at an instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct TerminalVoltages {
    /// Voltages to the lower rail in V.
    pub u: [f64; 3],
    /// Their counts, through the channel of the DC-link voltage.
    pub counts: [u32; 3],
    /// Bit x: the current of leg x flows from or to the upper rail.
    pub upper: u32,
    /// Bit x: the current of leg x flows from or to the lower rail. A leg with neither bit carries no current.
    pub lower: u32,
}

/// The sensors of a motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sensors {
    adc: AdcSetup,
    encoder: Encoder,
    hall: Hall,
}

impl Sensors {
    /// 12 bits, with a full scale of 1.5 times the current `i` (A) in both directions and of 1.5 times the voltage `u_dc` (V); an
    /// encoder of 1024 lines.
    pub(crate) fn of(i: f64, u_dc: f64) -> Self {
        let full = |x: f64| 1.5 * if x > 0.0 { x } else { 1.0 };
        let adc = AdcSetup {
            current_gain: 2048.0 / full(i),
            current_offset: 2048.0,
            voltage_gain: 4096.0 / full(u_dc),
            voltage_offset: 0.0,
            bits: 12,
            sensors: PHASES,
        };
        Self { adc, encoder: Encoder { counts: 4096, offset: 0.0 }, hall: Hall::default() }
    }

    pub(crate) fn adc_setup(&self) -> AdcSetup {
        self.adc
    }

    pub(crate) fn set_adc(&mut self, setup: AdcSetup) -> Result<()> {
        let AdcSetup { current_gain, current_offset, voltage_gain, voltage_offset, bits, sensors } = setup;
        for (name, gain) in [("current_gain", current_gain), ("voltage_gain", voltage_gain)] {
            if !gain.is_normal() {
                return Err(bad(name, gain, "finite and not 0"));
            }
        }
        for (name, offset) in [("current_offset", current_offset), ("voltage_offset", voltage_offset)] {
            finite(name, offset)?;
        }
        if !(1..=24).contains(&bits) {
            return Err(bad("bits", bits, "1 to 24"));
        }
        if sensors > LINK {
            return Err(bad("sensors", sensors, "0 (in the phases), 1 (below the legs), 2 (in the link)"));
        }
        self.adc = setup;
        Ok(())
    }

    pub(crate) fn encoder_setup(&self) -> EncoderSetup {
        EncoderSetup { counts: self.encoder.counts, offset: self.encoder.offset }
    }

    pub(crate) fn set_encoder(&mut self, EncoderSetup { offset, counts }: EncoderSetup) -> Result<()> {
        if !counts.is_multiple_of(4) || !(4..=1 << 24).contains(&counts) {
            return Err(bad("counts", counts, "a multiple of 4 from 4 to 16777216"));
        }
        finite("offset", offset)?;
        self.encoder = Encoder { counts, offset };
        Ok(())
    }

    pub(crate) fn set_hall(&mut self, offset: f64) -> Result<()> {
        finite("offset", offset)?;
        self.hall = Hall { offset };
        Ok(())
    }

    fn current(&self) -> Adc {
        Adc { gain: self.adc.current_gain, offset: self.adc.current_offset, bits: self.adc.bits }
    }

    fn voltage(&self) -> Adc {
        Adc { gain: self.adc.voltage_gain, offset: self.adc.voltage_offset, bits: self.adc.bits }
    }

    /// Whether the current sensors need the state of the legs.
    pub(crate) fn has_shunts(&self) -> bool {
        self.adc.sensors != PHASES
    }

    /// The counts of the phase currents `i` (A), which flow from or to the `upper` rail, and of the link voltage `u_dc` (V).
    pub(crate) fn counts(&self, i: [f64; 3], upper: [Option<bool>; 3], u_dc: f64) -> AdcCounts {
        let i = match self.adc.sensors {
            LOW_SIDE => shunt::below(i, upper),
            LINK => [shunt::link(i, upper), 0.0, 0.0],
            _ => i,
        };
        let current = self.current();
        AdcCounts { i: i.map(|i| current.count(i)), u_dc: self.voltage().count(u_dc) }
    }

    /// The reading of the encoder at the mechanical `angle` (rad).
    pub(crate) fn encoder(&self, angle: f64) -> EncoderCount {
        let read = self.encoder.read(angle);
        let bits = u32::from(read.a) | u32::from(read.b) << 1 | u32::from(read.index) << 2;
        EncoderCount { count: read.count, turns: read.turns, bits }
    }

    /// The bits of the Hall sensors at the electrical angle `theta_e` (rad).
    pub(crate) fn hall(&self, theta_e: f64) -> u32 {
        self.hall.bits(theta_e)
    }

    /// The reading of the terminals.
    pub(crate) fn terminals(&self, Terminals { u, upper }: Terminals) -> TerminalVoltages {
        let (voltage, bits) =
            (self.voltage(), |rail: bool| (0..3).map(|x| u32::from(upper[x] == Some(rail)) << x).sum());
        TerminalVoltages { u, counts: u.map(|u| voltage.count(u)), upper: bits(true), lower: bits(false) }
    }
}

fn bad(name: &str, value: impl std::fmt::Display, allowed: &str) -> Error {
    Error::value(ErrorCode::BadValue, name, value, allowed)
}

fn finite(name: &str, x: f64) -> Result<()> {
    if x.is_finite() { Ok(()) } else { Err(bad(name, x, "a finite number")) }
}
