//! A node of a CAN bus: receives a speed and confirms each frame.
//!
//! Low cut of FMI-LS-BUS 1.0.0, as `can-sensor`; here the node ticks `Tx_Clock` itself, at the instant of the frame.

use fmu_core::unit::RAD_PER_S;
use fmu_core::{
    Block, Bytes, Clock, Clocked, Elapsed, Experiment, Fault, Info, Member, Model, Row, Step, Table, Terminal, table,
};
use serde::{Deserialize, Serialize};

/// Codes of operations.
const TRANSMIT: u32 = 0x10;
const CONFIRM: u32 = 0x20;
/// Type and maximum size of the data.
const CAN: (&str, usize) = ("application/org.fmi-standard.fmi-ls-bus.can; version=\"1.0.0\"", 2048);

#[derive(Clone, Default, Serialize, Deserialize)]
struct CanDisplay {
    /// Operations that wait for the tick, which takes them out.
    received: Bytes,
    /// A confirmation must be sent.
    confirms: bool,
    out: Outputs,
}

#[derive(Clone, Default, Serialize, Deserialize)]
struct Outputs {
    sent: Bytes,
    speed: f64,
    id: u32,
    frames: u32,
}

type V = Row<Block<CanDisplay>>;

impl Model for CanDisplay {
    type Outputs = Outputs;
    const INFO: Info = Info {
        name: "CanDisplay",
        description: "Shows a speed that it receives over a CAN bus",
        author: env!("CARGO_PKG_AUTHORS"),
        license: env!("CARGO_PKG_LICENSE"),
        copyright: "The sensorless-drive developers",
        experiment: Experiment { stop: 0.1, step: 0.005, ..Experiment::DEFAULT },
        ..Info::DEFAULT
    };
    const TABLE: &'static Table<Block<Self>> = table![
        V::clock("Rx_Clock", "Operations arrive", Clock::triggered()),
        V::clock_output("Tx_Clock", "A confirmation is sent").on("Rx_Clock"),
        V::binary_input("Rx_Data", "Operations received", CAN.0, CAN.1, |m| &mut m.model.received).on("Rx_Clock"),
        V::binary_output("Tx_Data", "Operations sent", CAN.0, CAN.1, |m| &mut m.out.sent).on("Tx_Clock"),
        V::discrete_output("speed", &RAD_PER_S, "Speed received last", |m| &mut m.out.speed).on("Rx_Clock"),
        V::uint32_output("id", "Identifier of the last frame", |m| &mut m.out.id).on("Rx_Clock"),
        V::uint32_output("frames", "Frames received", |m| &mut m.out.frames).on("Rx_Clock"),
    ];
    const TERMINALS: &'static [Terminal] = &[Terminal::transceiver(
        "bus",
        "The CAN bus",
        &[Member::signal("Tx_Data"), Member::signal("Tx_Clock"), Member::signal("Rx_Data"), Member::signal("Rx_Clock")],
    )];

    fn initialize(&mut self) {
        *self = Self::default();
    }

    fn output(&self, _now: Elapsed, out: &mut Outputs) {
        out.clone_from(&self.out);
    }

    fn advance(&mut self, _step: &Step) -> Result<(), Fault> {
        Ok(())
    }
}

impl Clocked for CanDisplay {
    const FEEDTHROUGH: bool = true;

    fn tick(&mut self, _clock: usize, _now: Elapsed) -> Result<(), Fault> {
        self.out.sent.clear();
        let mut rest: &[u8] = &self.received;
        while let Some((code, arguments)) = next(&mut rest)? {
            if code != TRANSMIT {
                continue;
            }
            let word = |at: usize| arguments.get(at..at + 4).and_then(|x| x.try_into().ok()).map(u32::from_le_bytes);
            let data = arguments.get(8..16).and_then(|x| x.try_into().ok()).map(f64::from_le_bytes);
            let (Some(id), Some(speed)) = (word(0), data) else {
                return Err(Fault::new(format!("Rx_Data: a frame of {} bytes has no speed", arguments.len())));
            };
            (self.out.id, self.out.speed) = (id, speed);
            self.out.frames += 1;
            for word in [CONFIRM, 12, id] {
                self.out.sent.extend(&word.to_le_bytes());
            }
            self.confirms = true;
        }
        self.received.clear();
        Ok(())
    }

    fn ticked(&mut self, _clock: usize) -> bool {
        std::mem::take(&mut self.confirms)
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

fmu_export::export!(CanDisplay: Clocked);
