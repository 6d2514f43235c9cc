//! Calls on a virtual motor. The first byte selects how it is created: from its defaults, or from the text up to the next zero byte, as
//! a motor file or as a preset. Then a byte selects each call, and the following bytes are its arguments.

use virtual_motor::sensing::{AdcSetup, EncoderSetup};
use virtual_motor::{Result, VirtualMotor};

/// Longest advance in s: a motor that is sent to a distant time is busy for as long as that takes.
const LONGEST: f64 = 2e-3;

/// Bytes that become arguments; zeros after the end.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn next<const N: usize>(&mut self) -> [u8; N] {
        let mut taken = [0; N];
        let n = N.min(self.0.len());
        taken[..n].copy_from_slice(&self.0[..n]);
        self.0 = &self.0[n..];
        taken
    }

    fn byte(&mut self) -> u8 {
        self.next::<1>()[0]
    }

    fn number(&mut self) -> f64 {
        // Half of them of a usual size.
        let kind = self.byte();
        if kind < 128 { f64::from(kind) / 127.0 } else { f64::from_le_bytes(self.next()) }
    }

    fn integer(&mut self) -> u32 {
        u32::from_le_bytes(self.next())
    }
}

/// Runs the calls; a refused one must change nothing.
pub(crate) fn run(bytes: &[u8]) {
    let Some((kind, rest)) = bytes.split_first() else { return };
    let (text, rest) = if kind.is_multiple_of(3) {
        (None, rest)
    } else {
        let end = rest.iter().position(|b| *b == 0).unwrap_or(rest.len());
        (std::str::from_utf8(&rest[..end]).ok(), rest.get(end + 1..).unwrap_or_default())
    };
    let created = match (kind % 3, text) {
        (0, _) => Ok(VirtualMotor::default()),
        (1, Some(text)) => VirtualMotor::from_motor_text(text),
        (_, Some(text)) => VirtualMotor::from_preset(text),
        _ => return,
    };
    let Ok(mut motor) = created else { return };
    let mut bytes = Bytes(rest);
    for _ in 0..200 {
        if bytes.0.is_empty() {
            return;
        }
        let before = (motor.time(), motor.encoder().count, motor.hall(), values(&mut motor));
        let result = call(&mut motor, &mut bytes);
        if result.is_err() {
            let after = (motor.time(), motor.encoder().count, motor.hall(), values(&mut motor));
            assert!(before == after, "{result:?} has changed {before:?} to {after:?}");
        }
    }
}

/// Bits of the first variables, outputs and states among them.
fn values(motor: &mut VirtualMotor) -> Vec<Option<u64>> {
    (1..60).map(|variable| motor.get(variable).ok().map(f64::to_bits)).collect()
}

fn call(motor: &mut VirtualMotor, bytes: &mut Bytes<'_>) -> Result<()> {
    match bytes.byte() % 9 {
        0 => {
            let t = time(motor, bytes);
            let duties = [bytes.number(), bytes.number(), bytes.number()];
            let enable = bytes.byte().is_multiple_of(2);
            motor.advance_duties(t, duties, enable)
        }
        1 => {
            let t = time(motor, bytes);
            motor.advance_gates(t, bytes.byte().into())
        }
        2 => {
            let variable = u32::from(bytes.next::<2>()[0]) % 128;
            motor.set(variable, bytes.number())
        }
        3 => motor.get(bytes.integer()).map(|_| ()),
        4 => motor.adc().map(|_| ()),
        5 => motor.terminals().map(|_| ()),
        6 => motor.set_adc(AdcSetup {
            current_gain: bytes.number(),
            current_offset: bytes.number(),
            voltage_gain: bytes.number(),
            voltage_offset: bytes.number(),
            bits: u32::from(bytes.byte()),
            sensors: u32::from(bytes.byte()) % 4,
        }),
        7 => motor.set_encoder(EncoderSetup { offset: bytes.number(), counts: bytes.integer() }),
        _ => motor.set_hall(bytes.number()),
    }
}

/// A time soon after the present one, before it, or no time.
fn time(motor: &VirtualMotor, bytes: &mut Bytes<'_>) -> f64 {
    let t = bytes.number();
    if t.is_finite() && t >= 0.0 { motor.time() + t.min(1.0) * LONGEST } else { t }
}
