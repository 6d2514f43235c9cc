//! Terminals and icons as in a file (FMI 3.0.2, 2.4.9; FMI 2.0.5, 2.3 refers to the file of FMI 3.0).

/// A terminalsAndIcons.xml.
#[derive(Clone, Debug, PartialEq)]
pub struct TerminalsAndIcons {
    /// The standard that defines the file: 3.0, in an FMU of FMI 2.0 as well.
    pub fmi_version: String,
    /// The coordinate system; the standard's default if the file does not specify one.
    pub coordinates: CoordinateSystem,
    /// Position of the FMU's icon.
    pub icon: Option<Area>,
    /// The terminals, in the order of the file.
    pub terminals: Vec<Terminal>,
}

impl TerminalsAndIcons {
    /// The terminal at a path of names joined by dots, such as `outer.inner`; names may contain dots themselves.
    pub fn terminal(&self, path: &str) -> Option<&Terminal> {
        find(&self.terminals, path)
    }
}

fn find<'a>(terminals: &'a [Terminal], path: &str) -> Option<&'a Terminal> {
    let inside = |t: &'a Terminal| match path.strip_prefix(&*t.name)? {
        "" => Some(t),
        rest => find(&t.terminals, rest.strip_prefix('.')?),
    };
    terminals.iter().find_map(inside)
}

/// Two corners: the lower left and the upper right one, unless a picture is flipped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Area {
    /// x of the first corner.
    pub x1: f64,
    /// y of the first corner.
    pub y1: f64,
    /// x of the second corner.
    pub x2: f64,
    /// y of the second corner.
    pub y2: f64,
}

/// The coordinate system of all pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoordinateSystem {
    /// Its lower left and upper right corner.
    pub area: Area,
    /// Factor from a coordinate to mm.
    pub to_mm: f64,
}

impl Default for CoordinateSystem {
    fn default() -> Self {
        Self { area: Area { x1: -100.0, y1: -100.0, x2: 100.0, y2: 100.0 }, to_mm: 0.1 }
    }
}

/// A terminal.
#[derive(Clone, Debug, PartialEq)]
pub struct Terminal {
    /// Name, unique among its siblings.
    pub name: String,
    /// `plug`, `bus`, `sequence`, `none`, or a rule defined elsewhere.
    pub matching_rule: String,
    /// Kind, defined outside the standard.
    pub kind: Option<String>,
    /// One sentence.
    pub description: Option<String>,
    /// Variables.
    pub members: Vec<Member>,
    /// Variables of transported quantities.
    pub streams: Vec<StreamMember>,
    /// Terminals inside this one.
    pub terminals: Vec<Terminal>,
    /// Its appearance.
    pub picture: Option<TerminalPicture>,
    /// Line of the element.
    pub line: usize,
}

/// A variable of a terminal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Member {
    /// Name of the variable.
    pub variable: String,
    /// Name within the terminal.
    pub name: Option<String>,
    /// `signal`, `inflow`, `outflow`, or a kind defined elsewhere.
    pub kind: String,
    /// Line of the element.
    pub line: usize,
}

/// The two variables of a transported quantity.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StreamMember {
    /// Variable and member name of the inflow.
    pub inside: (String, String),
    /// Variable and member name of the outflow.
    pub outside: (String, String),
    /// Line of the element.
    pub line: usize,
}

/// Appearance of a terminal.
#[derive(Clone, Debug, PartialEq)]
pub struct TerminalPicture {
    /// Where.
    pub area: Area,
    /// Base name of the picture's files.
    pub icon: String,
    /// Color of its connections: red, green, blue.
    pub color: Option<[u8; 3]>,
    /// Width of its connections, in the coordinate system.
    pub stroke: Option<f64>,
    /// Line of the element.
    pub line: usize,
}
