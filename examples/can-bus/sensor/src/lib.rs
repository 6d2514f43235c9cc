//! A node of a CAN bus: sends the measured speed in a frame at each period, and counts the confirmations.
//!
//! Low cut of FMI-LS-BUS 1.0.0: `Tx_Data` is on the clock `Tx_Clock`, whose ticks the node requests from the importer;
//! `Rx_Data` is on `Rx_Clock`, which another node ticks. An operation is a code and a length of 4 bytes each, then its
//! arguments, little-endian.

use fmu_core::unit::{RAD_PER_S, SECOND};
use fmu_core::{
    Block, Bytes, Clock, Clocked, Elapsed, Experiment, Fault, Info, Member, Model, Row, Step, Table, Terminal, table,
};
use serde::{Deserialize, Serialize};

/// Codes of operations.
const TRANSMIT: u32 = 0x10;
const CONFIRM: u32 = 0x20;
/// Bytes of data in a frame: a speed.
const DATA: u16 = 8;
/// Type and maximum size of the data.
const CAN: (&str, usize) = ("application/org.fmi-standard.fmi-ls-bus.can; version=\"1.0.0\"", 2048);

#[derive(Clone, Serialize, Deserialize)]
struct CanSensor {
    speed: f64,
    period: f64,
    id: u32,
    received: Bytes,
    out: Outputs,
}

impl Default for CanSensor {
    fn default() -> Self {
        Self { speed: 0.0, period: 0.01, id: 0x101, received: Bytes::default(), out: Outputs::default() }
    }
}

#[derive(Clone, Default, Serialize, Deserialize)]
struct Outputs {
    sent: Bytes,
    frames: u32,
    confirmed: u32,
}

type V = Row<Block<CanSensor>>;

impl Model for CanSensor {
    type Outputs = Outputs;
    const INFO: Info = Info {
        name: "CanSensor",
        description: "Sends a measured speed over a CAN bus",
        author: env!("CARGO_PKG_AUTHORS"),
        license: env!("CARGO_PKG_LICENSE"),
        copyright: "The sensorless-drive developers",
        experiment: Experiment { stop: 0.1, step: 0.005, ..Experiment::DEFAULT },
        ..Info::DEFAULT
    };
    const TABLE: &'static Table<Block<Self>> = table![
        V::clock("Tx_Clock", "A frame is sent", Clock::changing()),
        V::clock("Rx_Clock", "Operations arrive", Clock::triggered()),
        V::binary_output("Tx_Data", "Operations sent", CAN.0, CAN.1, |m| &mut m.out.sent).on("Tx_Clock"),
        V::binary_input("Rx_Data", "Operations received", CAN.0, CAN.1, |m| &mut m.model.received).on("Rx_Clock"),
        V::discrete_input("speed", &RAD_PER_S, "Measured speed", |m| &mut m.model.speed),
        V::parameter("period", &SECOND, "Time from frame to frame", |m| &mut m.model.period).above(0.0),
        V::uint32_parameter("id", "Identifier of the frame", |m| &mut m.model.id).at_most(2047.0),
        V::uint32_output("frames", "Frames sent", |m| &mut m.out.frames).on("Tx_Clock"),
        V::uint32_output("confirmed", "Confirmations received", |m| &mut m.out.confirmed).on("Rx_Clock"),
    ];
    const TERMINALS: &'static [Terminal] = &[Terminal::transceiver(
        "bus",
        "The CAN bus",
        &[Member::signal("Tx_Data"), Member::signal("Tx_Clock"), Member::signal("Rx_Data"), Member::signal("Rx_Clock")],
    )];

    fn initialize(&mut self) {
        self.out = Outputs::default();
    }

    fn output(&self, _now: Elapsed, out: &mut Outputs) {
        out.clone_from(&self.out);
    }

    fn advance(&mut self, _step: &Step) -> Result<(), Fault> {
        Ok(())
    }
}

impl Clocked for CanSensor {
    const FEEDTHROUGH: bool = true;

    fn tick(&mut self, clock: usize, _now: Elapsed) -> Result<(), Fault> {
        if clock == 0 {
            let sent = &mut self.out.sent;
            sent.clear();
            for word in [TRANSMIT, 16 + u32::from(DATA), self.id] {
                sent.extend(&word.to_le_bytes());
            }
            // Neither an extended identifier nor a remote frame.
            sent.extend(&[0, 0]);
            sent.extend(&DATA.to_le_bytes());
            sent.extend(&self.speed.to_le_bytes());
            self.out.frames += 1;
            return Ok(());
        }
        let mut rest: &[u8] = &self.received;
        while let Some((code, operation)) = next(&mut rest)? {
            self.out.confirmed += u32::from(code == CONFIRM && operation == self.id.to_le_bytes());
        }
        Ok(())
    }

    /// Frame k is sent k periods after the start.
    fn interval(&self, _clock: usize, now: Elapsed) -> Option<f64> {
        Some(f64::from(self.out.frames + 1).mul_add(self.period, -now.seconds()))
    }
}

/// Takes the next operation, its code and its arguments.
fn next<'a>(rest: &mut &'a [u8]) -> Result<Option<(u32, &'a [u8])>, Fault> {
    if rest.is_empty() {
        return Ok(None);
    }
    let word = |at: usize| rest.get(at..at + 4).and_then(|x| x.try_into().ok()).map(u32::from_le_bytes);
    let length = word(4).and_then(|length| usize::try_from(length).ok()).filter(|n| (8..=rest.len()).contains(n));
    let (Some(code), Some(length)) = (word(0), length) else {
        return Err(Fault::new(format!("Rx_Data: {} bytes are not an operation", rest.len())));
    };
    let (operation, after) = rest.split_at(length);
    *rest = after;
    Ok(Some((code, &operation[8..])))
}

fmu_export::export!(CanSensor: Clocked);
