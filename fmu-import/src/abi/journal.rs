//! The current call of an FMU, in memory that another process can read after this one has died. A call costs two stores.

macro_rules! calls {
    ($($name:ident = $text:literal,)*) => {
        /// The kinds of calls.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[expect(missing_docs, reason = "the texts tell")]
        pub enum Call { $($name,)* }

        const TEXTS: &[(Call, &str)] = &[$((Call::$name, $text),)*];
    };
}

calls! {
    Start = "the start",
    Load = "loading the library",
    Instantiate = "the instantiation",
    Setup = "setting up the experiment",
    EnterInitialization = "entering initialization mode",
    ExitInitialization = "leaving initialization mode",
    Get = "getting values",
    Set = "setting values",
    Step = "a step",
    Events = "an event or the end of a step",
    Evaluation = "an evaluation",
    State = "a call for the FMU state",
    Reset = "the reset",
    Terminate = "the termination",
    Free = "freeing the instance or unloading the library",
    Write = "writing the results",
    Describe = "describing the model (its outputs are computed with other values)",
}

/// The last action of a process.
#[derive(Clone, Debug, PartialEq)]
pub struct Last {
    /// Name of the instance, or path of the FMU that is loaded.
    pub name: String,
    /// The current call, or the last one.
    pub call: Call,
    /// The last communication point in s, if any.
    pub time: Option<f64>,
    /// Changes with every communication point, and with every call that a run makes only once.
    pub progress: u64,
}

impl Last {
    /// `p: a step after t = 0.1 s`.
    pub fn describe(&self) -> String {
        let call = TEXTS.iter().find(|(call, _)| *call == self.call).map_or("a call", |(_, text)| text);
        let time = self.time.map(|t| format!(" at or after t = {t} s")).unwrap_or_default();
        let name = if self.name.is_empty() { String::new() } else { format!("{}: ", self.name) };
        format!("{name}{call}{time}")
    }
}

#[cfg(unix)]
mod unix {
    use super::{Call, Last, TEXTS};
    use crate::text::printable;
    use rustix::mm::{MapFlags, ProtFlags, mmap};
    use std::fs::{self, File};
    use std::io::{self, Write};
    use std::path::Path;
    use std::ptr;
    use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
    use std::sync::{Mutex, OnceLock, PoisonError};

    const CALL: &str = "journal-call";
    const NAMES: &str = "journal-names";
    const BYTES: usize = 4096;

    /// Words of the page: instance and call, time, progress.
    struct Page(&'static [AtomicU64; 3]);

    static PAGE: OnceLock<Page> = OnceLock::new();
    static NAMED: OnceLock<Mutex<(u32, File)>> = OnceLock::new();

    /// Keeps the journal of this process in a folder from now on.
    ///
    /// # Errors
    /// The files cannot be made.
    pub fn open(folder: &Path) -> io::Result<()> {
        let file = File::options().read(true).write(true).create(true).truncate(true).open(folder.join(CALL))?;
        file.set_len(BYTES as u64)?;
        // SAFETY: a new mapping at an address that the system chooses overlaps no other memory.
        let page =
            unsafe { mmap(ptr::null_mut(), BYTES, ProtFlags::READ | ProtFlags::WRITE, MapFlags::SHARED, &file, 0) }?;
        // SAFETY: the mapping is aligned to pages, larger than three words, and never undone. Atomic words may be read and
        // written by other processes at any time; truncating the file would end this process by a signal.
        let page = unsafe { &*page.cast::<[AtomicU64; 3]>() };
        page[1].store(f64::NAN.to_bits(), Relaxed);
        let names = File::options().append(true).create(true).open(folder.join(NAMES))?;
        let _ = NAMED.set(Mutex::new((0, names)));
        let _ = PAGE.set(Page(page));
        Ok(())
    }

    /// A number for a name.
    pub(crate) fn name(name: &str) -> u32 {
        let Some(named) = NAMED.get() else { return 0 };
        let mut named = named.lock().unwrap_or_else(PoisonError::into_inner);
        let _ = writeln!(named.1, "{}", printable(name));
        named.0 += 1;
        named.0
    }

    /// Records the call that is about to be made.
    #[inline]
    pub(crate) fn note(id: u32, call: Call) {
        if let Some(Page(words)) = PAGE.get() {
            words[0].store(u64::from(id) << 8 | call as u64, Relaxed);
            if !matches!(call, Call::Get | Call::Set | Call::Step | Call::Events | Call::Evaluation | Call::State) {
                words[2].fetch_add(1, Relaxed);
            }
        }
    }

    /// The run has reached a communication point, at this time in s.
    pub fn reached(time: f64) {
        if let Some(Page(words)) = PAGE.get() {
            words[1].store(time.to_bits(), Relaxed);
            words[2].fetch_add(1, Relaxed);
        }
    }

    /// The run is over, and its results are written.
    pub fn writes() {
        note(0, Call::Write);
        if let Some(Page(words)) = PAGE.get() {
            words[1].store(f64::NAN.to_bits(), Relaxed);
        }
    }

    /// The last action of the process that keeps its journal in this folder; `None` before it has begun.
    pub fn read(folder: &Path) -> Option<Last> {
        let bytes = fs::read(folder.join(CALL)).ok()?;
        let word = |index: usize| Some(u64::from_ne_bytes(bytes.get(8 * index..8 * index + 8)?.try_into().ok()?));
        let (call, time) = (word(0)?, f64::from_bits(word(1)?));
        let names = fs::read_to_string(folder.join(NAMES)).unwrap_or_default();
        let place = usize::try_from(call >> 8).ok()?.checked_sub(1);
        Some(Last {
            name: place.and_then(|place| names.lines().nth(place)).unwrap_or_default().to_owned(),
            call: TEXTS.get(usize::try_from(call & 0xff).ok()?)?.0,
            time: (!time.is_nan()).then_some(time),
            progress: word(2)?,
        })
    }
}

#[cfg(unix)]
pub(crate) use unix::{name, note};
#[cfg(unix)]
pub use unix::{open, reached, read, writes};

#[cfg(not(unix))]
mod other {
    use super::{Call, Last};
    use std::path::Path;

    /// Other systems have no journal.
    ///
    /// # Errors
    /// None.
    pub fn open(_: &Path) -> std::io::Result<()> {
        Ok(())
    }
    pub(crate) fn name(_: &str) -> u32 {
        0
    }
    pub(crate) fn note(_: u32, _: Call) {}
    /// Nothing here.
    pub fn reached(_: f64) {}
    /// Nothing here.
    pub fn writes() {}
    /// Nothing here.
    pub fn read(_: &Path) -> Option<Last> {
        None
    }
}

#[cfg(not(unix))]
pub(crate) use other::{name, note};
#[cfg(not(unix))]
pub use other::{open, reached, read, writes};
