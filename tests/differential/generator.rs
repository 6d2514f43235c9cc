//! Random models as sources in Rust: a function of the seed. Each has a table of variables of every type, causality, variability and unit,
//! and arrays; some have states, events, clocks and sizes.

#![allow(clippy::format_collect, reason = "lines of a source")]

use fmu_core::draw::Draw;
use std::fmt::Write;

/// What a model can do beyond Co-Simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Sort {
    /// A discrete state that each communication step advances.
    Plain,
    /// States.
    Continuous,
    /// States, and events on a grid of times.
    TimeEvents,
    /// States, events on a grid of times and where a state crosses a level, Event Mode.
    StateEvents,
    /// A clock that samples the inputs, and Scheduled Execution: FMI 3.0 only.
    Clocked,
}

/// The sort of the model of a seed.
pub(crate) fn sort(seed: u64) -> Sort {
    [Sort::Plain, Sort::Continuous, Sort::TimeEvents, Sort::StateEvents, Sort::Clocked]
        [usize::try_from(seed % 5).unwrap()]
}

/// The name of the model of a seed.
pub(crate) fn name(seed: u64) -> String {
    format!("Random{seed}")
}

const INTEGERS: [(&str, &str); 8] = [
    ("int8", "i8"),
    ("uint8", "u8"),
    ("int16", "i16"),
    ("uint16", "u16"),
    ("integer", "i32"),
    ("uint32", "u32"),
    ("int64", "i64"),
    ("uint64", "u64"),
];

const UNITS: [&str; 24] = [
    "ONE",
    "VOLT",
    "AMPERE",
    "OHM",
    "HENRY",
    "KELVIN",
    "NEWTON_METER",
    "WATT",
    "JOULE",
    "RADIAN",
    "SPEED",
    "SECOND",
    "METER",
    "METER_PER_S",
    "KILOGRAM",
    "PASCAL",
    "HERTZ",
    "COULOMB",
    "TESLA",
    "KG_M2",
    "PER_SECOND",
    "RAD_PER_S",
    "FARAD",
    "WEBER",
];

/// Units of a state and of its derivative.
const STATES: [(&str, &str); 5] = [
    ("ONE", "PER_SECOND"),
    ("METER", "METER_PER_S"),
    ("VOLT", "VOLT_PER_S"),
    ("AMPERE", "AMPERE_PER_S"),
    ("KELVIN", "KELVIN_PER_S"),
];

/// The parts of a source.
struct Source {
    draw: Draw,
    names: usize,
    /// Rows of the table.
    rows: String,
    /// Fields of the model with type and start value, and fields of the outputs.
    fields: Vec<(String, String, String)>,
    outputs: Vec<(String, String)>,
    /// Expressions of type f64 that outputs may use: those that change at events only, and all.
    discrete: Vec<String>,
    all: Vec<String>,
    /// Statements of `output`, of `derive` and of `resize`.
    output: String,
    derive: String,
    resize: String,
    /// Units of the derivatives.
    rates: Vec<&'static str>,
    /// Rows get this at their end: the clock that they are on.
    on: &'static str,
}

impl Source {
    fn chance(&mut self, percent: usize) -> bool {
        self.draw.below(100) < percent
    }

    /// A number with few or many digits, small or great.
    fn number(&mut self) -> f64 {
        match self.draw.below(6) {
            0 => 0.0,
            1 => self.draw.of(&[1.0, -1.0, 0.5, 10.0, 1e-3]),
            2 => (self.draw.around(100.0) * 8.0).round() / 8.0,
            3 => self.draw.scaled(1e-6, 1e4),
            _ => self.draw.around(10.0),
        }
    }

    fn unit(&mut self) -> &'static str {
        self.draw.of(&UNITS)
    }

    /// A structured name, some with quotation marks.
    fn name(&mut self) -> String {
        self.names += 1;
        let n = self.names;
        match self.draw.below(8) {
            0 => format!("part.x{n}"),
            1 => format!("a.b_c.'value no. {n} [<&>]'"),
            2 => format!("'{n}: one, two'"),
            3 => format!("der_{n}"),
            _ => format!("x{n}"),
        }
    }

    fn description(&mut self) -> String {
        self.draw
            .of(&["", "A variable", "R < 5 & \\\"quoted\\\"", "\u{3c8} in \u{b5}Wb", "  blanks  ", "Ends with ]]>"])
            .to_owned()
    }

    /// Bounds around a start value.
    fn bounds(&mut self, start: f64) -> String {
        let (low, high) = (start - 1.0 - self.draw.scaled(0.1, 10.0), start + 1.0 + self.draw.scaled(0.1, 10.0));
        match self.draw.below(5) {
            0 => format!(".at_least({low:?})"),
            1 => format!(".above({low:?}).at_most({high:?})"),
            2 => format!(".at_least({low:?}).below({high:?})"),
            _ => String::new(),
        }
    }

    fn field(&mut self, kind: &str, start: &str) -> String {
        let field = format!("f{}", self.fields.len());
        self.fields.push((field.clone(), kind.into(), start.into()));
        field
    }

    fn row(&mut self, row: &str) {
        let _ = writeln!(self.rows, "        {row},");
    }

    /// A real variable that the importer sets.
    fn real_in(&mut self, constructor: &str, discrete: bool) {
        let (name, about, unit, start) = (self.name(), self.description(), self.unit(), self.number());
        let field = self.field("f64", &format!("{start:?}"));
        let mut more = self.bounds(start);
        if constructor == "parameter" && self.chance(40) {
            more += ".tunable()";
        }
        if constructor != "parameter" {
            more += self.on;
        }
        self.row(&format!("V::{constructor}({name:?}, &{unit}, \"{about}\", |m| &mut m.model.{field}){more}"));
        self.all.push(format!("self.{field}"));
        if discrete {
            self.discrete.push(format!("self.{field}"));
        }
    }

    /// A variable of another type that the importer sets.
    fn other_in(&mut self, causality: &str) {
        let (name, about) = (self.name(), self.description());
        let on = if causality == "input" { self.on } else { "" };
        match self.draw.below(5) {
            0 => {
                let start = self.chance(50);
                let field = self.field("bool", &start.to_string());
                self.row(&format!("V::boolean_{causality}({name:?}, \"{about}\", |m| &mut m.model.{field}){on}"));
                self.discrete.push(format!("f64::from(u8::from(self.{field}))"));
            }
            1 => {
                let (start, unit) = (self.draw.of(&["0.1", "-2.5", "3.0"]), self.unit());
                let field = self.field("f32", start);
                self.row(&format!(
                    "V::float32_{causality}({name:?}, &{unit}, \"{about}\", |m| &mut m.model.{field}){on}"
                ));
                self.discrete.push(format!("f64::from(self.{field})"));
            }
            2 => {
                let start = self.draw.of(&["Fan::Off", "Fan::On", "Fan::Fast"]);
                let field = self.field("Fan", start);
                self.row(&format!(
                    "V::enumeration_{causality}({name:?}, \"{about}\", &Field(|m| &mut m.model.{field})){on}"
                ));
                self.discrete.push(format!("f64::from(self.{field}.clone() as i32)"));
            }
            _ => {
                let (of, kind) = self.draw.of(&INTEGERS);
                let start = self.draw.below(100);
                let bounded = if self.chance(50) { ".at_least(0.0).at_most(100.0)" } else { "" };
                let field = self.field(kind, &start.to_string());
                self.row(&format!("V::{of}_{causality}({name:?}, \"{about}\", |m| &mut m.model.{field}){bounded}{on}"));
                self.discrete.push(format!("self.{field} as f64"));
            }
        }
        self.all.push(self.discrete.last().unwrap().clone());
    }

    fn text_in(&mut self) {
        let (name, about) = (self.name(), self.description());
        let start = self.draw.of(&["", "a text", "<&> \u{b5}"]);
        let field = self.field("String", &format!("{start:?}.into()"));
        self.row(&format!("V::text_parameter({name:?}, \"{about}\", |m| &mut m.model.{field})"));
        let (name, other) = (self.name(), self.draw.of(&["off", "", "\u{3c8}"]));
        self.row(&format!(
            "V::text_output({name:?}, \"\", |m| if m.model.{field}.len() > 3 {{ &m.model.{field} }} else {{ {other:?} }})"
        ));
    }

    /// An array, and an output of its shape. With `size`, a structural parameter chooses its length.
    fn array(&mut self, size: Option<&(String, String)>) {
        let (name, about, unit) = (self.name(), self.description(), self.unit());
        let parameter = self.chance(50);
        let (n, kind, shape) = match size {
            Some((size, _)) => (6, "Vec<f64>", format!(".sized(&[{size:?}])")),
            None => match self.draw.below(3) {
                0 => (6, "Vec<f64>", ".shape(&[2, 3])".to_owned()),
                1 => (4, "Vec<f64>", ".shape(&[2, 1, 2])".to_owned()),
                _ => (1 + self.draw.below(6), "Vec<f64>", String::new()),
            },
        };
        let length = size.map_or(n, |_| 3);
        let start: Vec<f64> = (0..length).map(|_| self.number()).collect();
        let field = self.field(kind, &format!("vec!{start:?}"));
        let constructor = if parameter { "array_parameter" } else { "array_input" };
        let on = if parameter { "" } else { self.on };
        self.row(&format!(
            "V::{constructor}({name:?}, &{unit}, \"{about}\", {n}, |m| &mut m.model.{field}){shape}{on}"
        ));
        let (name, factor) = (self.name(), self.number());
        let out = format!("o{}", self.outputs.len());
        self.outputs.push((out.clone(), "Vec<f64>".into()));
        let on = if parameter { "" } else { self.on };
        self.row(&format!("V::array_output({name:?}, &{unit}, \"{about}\", {n}, |m| &mut m.out.{out}){shape}{on}"));
        let _ = writeln!(
            self.output,
            "        out.{out}.clear();\n        out.{out}.extend(self.{field}.iter().map(|x| x * {factor:?} + 1.0));"
        );
        if let Some((_, size)) = size {
            let _ = writeln!(
                self.resize,
                "        let n = usize::try_from(self.{size}).unwrap_or(0);\n        if self.{field}.len() != n {{ self.{field} = vec![0.25; n]; }}"
            );
        } else {
            self.all.push(format!("self.{field}[0]"));
            if parameter {
                self.discrete.push(format!("self.{field}[0]"));
            }
        }
    }

    fn list(&mut self) {
        let (name, about, n) = (self.name(), self.description(), 1 + self.draw.below(4));
        let (_, kind) = self.draw.of(&INTEGERS);
        let start: Vec<usize> = (0..n).map(|_| self.draw.below(100)).collect();
        let field = self.field(&format!("[{kind}; {n}]"), &format!("{start:?}"));
        let constructor = self.draw.of(&["list_input", "list_parameter"]);
        let on = if constructor == "list_input" { self.on } else { "" };
        self.row(&format!("V::{constructor}({name:?}, \"{about}\", {n}, &Items(|m| &mut m.model.{field})){on}"));
        self.discrete.push(format!("self.{field}[{}] as f64", n - 1));
        self.all.push(self.discrete.last().unwrap().clone());
    }

    /// A sum of up to three terms of a list, some of them products.
    fn expression(&mut self, discrete: bool) -> String {
        let list = if discrete { self.discrete.clone() } else { self.all.clone() };
        let mut sum = format!("{:?}", self.number());
        for _ in 0..self.draw.below(4).min(list.len()) {
            let (term, factor) = (list[self.draw.below(list.len())].clone(), self.number());
            let _ = if self.chance(20) {
                write!(sum, " + ({term}) * ({term}) * ({factor:?})")
            } else {
                write!(sum, " + ({term}) * ({factor:?})")
            };
        }
        sum
    }

    fn out(&mut self, kind: &str, expression: &str) -> String {
        let out = format!("o{}", self.outputs.len());
        self.outputs.push((out.clone(), kind.into()));
        let _ = writeln!(self.output, "        out.{out} = {expression};");
        out
    }

    fn real_out(&mut self) {
        let (name, about, unit) = (self.name(), self.description(), self.unit());
        let discrete = self.chance(40) || !self.on.is_empty();
        let expression = self.expression(discrete);
        let out = self.out("f64", &expression);
        let mut constructor = if discrete {
            self.draw.of(&["discrete_output", "discrete_local"])
        } else {
            self.draw.of(&["output", "local"])
        };
        if !self.on.is_empty() {
            constructor = "discrete_output";
        }
        let on = self.on;
        self.row(&format!("V::{constructor}({name:?}, &{unit}, \"{about}\", |m| &mut m.out.{out}){on}"));
    }

    fn other_out(&mut self) {
        let (name, about, on) = (self.name(), self.description(), self.on);
        let expression = self.expression(true);
        let causality = self.draw.of(&["output", "local"]);
        match self.draw.below(5) {
            0 => {
                let out = self.out("bool", &format!("({expression}) > 1.0"));
                self.row(&format!("V::boolean_{causality}({name:?}, \"{about}\", |m| &mut m.out.{out}){on}"));
            }
            1 => {
                let (out, unit) = (self.out("f32", &format!("({expression}) as f32")), self.unit());
                self.row(&format!("V::float32_{causality}({name:?}, &{unit}, \"{about}\", |m| &mut m.out.{out}){on}"));
            }
            2 => {
                let out = self.out("Fan", &format!("if ({expression}) > 0.0 {{ Fan::On }} else {{ Fan::Fast }}"));
                self.row(&format!(
                    "V::enumeration_{causality}({name:?}, \"{about}\", &Field(|m| &mut m.out.{out})){on}"
                ));
            }
            _ => {
                let (of, kind) = self.draw.of(&INTEGERS);
                let out = self.out(kind, &format!("(({expression}) as i64).rem_euclid(100) as {kind}"));
                self.row(&format!("V::{of}_{causality}({name:?}, \"{about}\", |m| &mut m.out.{out}){on}"));
            }
        }
    }

    fn constants(&mut self) {
        let (a, b, c) = (self.name(), self.name(), self.name());
        let (unit, number) = (self.unit(), self.number());
        self.row(&format!("V::constant({a:?}, &{unit}, \"\", {number:?})"));
        self.row(&format!("V::integer_constant({b:?}, \"\", 8).as_output()"));
        self.row(&format!("V::text_constant({c:?}, \"\", \"r1 <\u{b5}>\")"));
    }

    fn calculated(&mut self) {
        let (name, unit) = (self.name(), self.unit());
        let field = self.field("f64", "0.0");
        let _ = writeln!(self.derive, "        self.{field} = 2.0 * self.tau;");
        self.row(&format!("V::calculated({name:?}, &{unit}, \"\", |m| &mut m.model.{field})"));
        self.all.push(format!("self.{field}"));
        self.discrete.push(format!("self.{field}"));
    }
}

/// The source of a model.
pub(crate) fn source(seed: u64) -> String {
    let sort = sort(seed);
    let mut s = Source {
        draw: Draw(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0xd1ff),
        names: 0,
        rows: String::new(),
        fields: Vec::new(),
        outputs: Vec::new(),
        discrete: Vec::new(),
        all: Vec::new(),
        output: String::new(),
        derive: String::new(),
        resize: String::new(),
        rates: Vec::new(),
        on: "",
    };
    s.fields.push(("tau".into(), "f64".into(), format!("{:?}", s.draw.of(&[0.5, 0.25, 1.0]))));
    s.row("V::parameter(\"tau\", &SECOND, \"Time constant\", |m| &mut m.model.tau).above(0.1).at_most(10.0)");
    if sort == Sort::Clocked {
        s.row("V::clock(\"tick\", \"Samples the inputs\", Clock::constant(0.125)).shift(0.0625).priority(3)");
        s.on = ".on(\"tick\")";
    }
    let resizable = matches!(sort, Sort::Plain | Sort::Continuous) && s.chance(40);
    let size = resizable.then(|| {
        let (name, field) = (s.name(), s.field("u64", "3"));
        s.row(&format!("V::structural({name:?}, \"Number of elements\", |m| &mut m.model.{field}).at_most(6.0)"));
        (name, field)
    });
    // What the importer sets.
    for _ in 0..s.draw.below(4) {
        s.real_in("parameter", true);
    }
    for _ in 0..s.draw.below(4) {
        s.other_in("parameter");
    }
    for _ in 0..s.draw.below(3) {
        if s.on.is_empty() {
            s.real_in("input", false);
        }
        s.real_in("discrete_input", true);
    }
    for _ in 0..s.draw.below(4) {
        s.other_in("input");
    }
    if s.chance(40) {
        s.text_in();
    }
    for _ in 0..s.draw.below(3) {
        s.array(None);
    }
    if let Some(size) = &size {
        for _ in 0..=s.draw.below(2) {
            s.array(Some(size));
        }
    }
    for _ in 0..s.draw.below(2) {
        s.list();
    }
    if s.chance(50) {
        s.calculated();
    }
    // Its state.
    s.fields.push(("held".into(), "f64".into(), "0.0".into()));
    s.fields.push(("count".into(), "u64".into(), "0".into()));
    let states = if matches!(sort, Sort::Plain | Sort::Clocked) { 0 } else { 1 + s.draw.below(3) };
    let update = s.expression(true);
    for i in 0..states {
        s.fields.push((format!("x{i}"), "f64".into(), format!("{:?}", s.draw.of(&[0.0, 1.0, -0.75]))));
    }
    let rates: Vec<String> = (0..states)
        .map(|i| {
            let input = s.expression(false);
            let row = if s.chance(50) { "output" } else { "state" };
            let ((unit, rate), about) = (s.draw.of(&STATES), s.description());
            s.rates.push(rate);
            s.row(&format!("V::{row}(\"state{i}\", &{unit}, \"{about}\", |m| &mut m.model.x{i}).nominal(2.0)"));
            format!("        dx[{i}] = ({input} - self.x{i}) / self.tau;\n")
        })
        .collect();
    for i in 0..states {
        s.all.push(format!("self.x{i}"));
    }
    s.discrete.push("self.held".into());
    s.all.push("self.held".into());
    // Its outputs.
    let (held, on) = (s.out("f64", "self.held"), s.on);
    s.row(&format!("V::discrete_output(\"held\", &ONE, \"The discrete state\", |m| &mut m.out.{held}){on}"));
    for _ in 0..=s.draw.below(4) {
        s.real_out();
    }
    for _ in 0..s.draw.below(4) {
        s.other_out();
    }
    if s.chance(40) {
        s.constants();
    }
    if sort == Sort::StateEvents {
        s.fields.push(("side".into(), "bool".into(), "false".into()));
        s.row("V::boolean_output(\"side\", \"A state is above its level\", |m| &mut m.model.side)");
    }
    write_source(seed, &s, &rates, &update, size.is_some())
}

fn write_source(seed: u64, s: &Source, rates: &[String], update: &str, resizable: bool) -> String {
    let (sort, name, states) = (sort(seed), name(seed), rates.len());
    let list = |items: &[(String, String)]| items.iter().map(|(n, t)| format!("    {n}: {t},\n")).collect::<String>();
    let fields: String = s.fields.iter().map(|(n, t, _)| format!("    {n}: {t},\n")).collect();
    let starts: String = s.fields.iter().map(|(n, _, start)| format!("            {n}: {start},\n")).collect();
    let outputs = list(&s.outputs);
    let starting: String = (0..states).map(|i| format!("        self.x{i} = {i}.5;\n")).collect();
    let side = if sort == Sort::StateEvents { "        self.side = self.x0 > 0.7;\n" } else { "" };
    let advance = match sort {
        Sort::Plain => {
            "        self.held = 0.5 * self.held + self.update();\n        self.count += 1;\n        let _ = step;\n        Ok(())"
        }
        Sort::Continuous => "        integrate::smooth::<Self, { Self::SCALARS }>(self, step, 1e-2)",
        Sort::TimeEvents | Sort::StateEvents => {
            "        integrate::hybrid::<Self, { Self::SCALARS }>(self, step, 1e-2)"
        }
        Sort::Clocked => "        let _ = step;\n        Ok(())",
    };
    let list_of_states: String = s
        .rates
        .iter()
        .enumerate()
        .map(|(i, rate)| format!("        State::new(\"state{i}\", &{rate}, |m: &mut Self| &mut m.x{i}).reinit(),\n"))
        .collect();
    let mut more = String::new();
    let mut capabilities = Vec::new();
    if states > 0 {
        capabilities.push("ContinuousTime");
        let _ = write!(
            more,
            "impl ContinuousTime for M {{\n    const STATES: &'static [State<Self>] = &[\n{list_of_states}    ];\n\n    \
             fn derivatives(&self, _now: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {{\n{}        Ok(())\n    }}\n}}\n\n",
            rates.concat()
        );
    }
    if matches!(sort, Sort::TimeEvents | Sort::StateEvents) {
        capabilities.push("Events");
        let level = sort == Sort::StateEvents;
        let indicators = if level {
            "    const INDICATORS: &'static [Indicator] = &[Indicator { name: \"z\", description: \"Distance from the level\" }];\n\n    \
             fn indicators(&self, _now: Elapsed, z: &mut [f64]) {\n        \
             z[0] = if self.side { self.x0 - 0.69 } else { self.x0 - 0.71 };\n    }\n\n"
        } else {
            ""
        };
        let crossing = if level {
            "        if self.side && self.x0 <= 0.69 {\n            self.side = false;\n        } else if !self.side && self.x0 >= 0.71 {\n            \
             self.side = true;\n        }\n"
        } else {
            ""
        };
        let _ = write!(
            more,
            "impl Events for M {{\n{indicators}    fn event(&mut self, now: Elapsed) -> Result<Outcome, Fault> {{\n        \
             let due = self.next(now).is_due(now);\n        if due {{\n            self.held = 0.5 * self.held + self.update();\n            \
             self.count += 1;\n            self.x0 *= 0.5;\n        }}\n{crossing}        \
             Ok(Outcome {{ states_changed: due, ..Outcome::default() }})\n    }}\n\n    \
             fn next(&self, _now: Elapsed) -> Next {{\n        Next::Grid {{ k: self.count + 1, period: 0.15 }}\n    }}\n}}\n\n"
        );
        if level {
            capabilities.push("EventMode");
            more += "impl EventMode for M {\n    fn to_event(&mut self, step: &Step) -> Result<Stop, Fault> {\n        \
                     integrate::to_event::<Self, { Self::SCALARS }>(self, step, 1e-2)\n    }\n}\n\n";
        }
    }
    if sort == Sort::Clocked {
        capabilities.extend(["Clocked", "ScheduledExecution"]);
        more += "impl Clocked for M {\n    const FEEDTHROUGH: bool = true;\n\n    \
                 fn tick(&mut self, _clock: usize, _now: Elapsed) -> Result<(), Fault> {\n        \
                 self.held = 0.5 * self.held + self.update();\n        self.count += 1;\n        Ok(())\n    }\n}\n\n";
    }
    if resizable {
        capabilities.push("Resizable");
        let _ = write!(
            more,
            "impl Resizable for M {{\n    fn resize(&mut self) -> Result<(), Fault> {{\n{}        Ok(())\n    }}\n}}\n\n",
            s.resize
        );
    }
    let capabilities = if capabilities.is_empty() { String::new() } else { format!(": {}", capabilities.join(" + ")) };
    format!(
        "//! The model of seed {seed}.\n#![allow(warnings)]\n\nuse fmu_core::unit::*;\nuse fmu_core::*;\nuse serde::{{Deserialize, Serialize}};\n\n\
         enumeration! {{\n    #[derive(Serialize, Deserialize)]\n    enum Fan(\"FanMode\", \"What <it> does\") {{\n        1 Off \"Stands\";\n        \
         2 On \"Turns\";\n        5 Fast \"Flies\";\n    }}\n}}\n\nimpl Default for Fan {{\n    fn default() -> Self {{\n        Fan::On\n    }}\n}}\n\n\
         #[derive(Clone, Serialize, Deserialize)]\nstruct M {{\n{fields}}}\n\n\
         impl Default for M {{\n    fn default() -> Self {{\n        Self {{\n{starts}        }}\n    }}\n}}\n\n\
         #[derive(Clone, Default, Serialize, Deserialize)]\nstruct Out {{\n{outputs}}}\n\ntype V = Row<Block<M>>;\n\n\
         impl M {{\n    fn update(&self) -> f64 {{\n        {update}\n    }}\n}}\n\n\
         impl Model for M {{\n    type Outputs = Out;\n\n    const INFO: Info = Info {{\n        name: \"{name}\",\n        \
         description: \"Random <model> & more\",\n        author: \"The tests\",\n        license: \"MIT OR Apache-2.0\",\n        \
         copyright: \"None\",\n        experiment: Experiment {{ stop: 1.0, step: 0.125, ..Experiment::DEFAULT }},\n        ..Info::DEFAULT\n    }};\n\n    \
         const TABLE: &'static Table<Block<Self>> = table![\n{}    ];\n\n    \
         fn derive(&mut self) {{\n{}    }}\n\n    \
         fn initialize(&mut self) {{\n        self.held = 0.0;\n        self.count = 0;\n{starting}{side}    }}\n\n    \
         fn output(&self, _now: Elapsed, out: &mut Out) {{\n{}    }}\n\n    \
         fn advance(&mut self, step: &Step) -> Result<(), Fault> {{\n{advance}\n    }}\n}}\n\n{more}fmu_export::export!(M{capabilities});\n",
        s.rows, s.derive, s.output
    )
}
