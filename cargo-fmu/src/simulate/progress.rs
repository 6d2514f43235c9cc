//! The progress of a run on a terminal.

use fmu_system::cosimulation::Settings;

/// A build without bars.
#[cfg(not(feature = "full"))]
pub(super) struct Progress;

#[cfg(not(feature = "full"))]
#[expect(clippy::unused_self, reason = "the functions of a bar")]
impl Progress {
    pub(super) fn new(_: Settings) -> Self {
        Self
    }

    pub(super) fn at(&mut self, _: f64) {}

    pub(super) fn end(&mut self) {}
}

#[cfg(feature = "full")]
pub(super) use bar::Progress;

#[cfg(feature = "full")]
mod bar {
    use super::Settings;
    use indicatif::{ProgressBar, ProgressStyle};
    use std::io::{self, IsTerminal};
    use std::time::{Duration, Instant};

    /// A progress bar on a terminal, if the run takes longer than a second.
    pub(in super::super) struct Progress {
        settings: Settings,
        begun: Instant,
        next: Duration,
        bar: Option<ProgressBar>,
    }

    impl Progress {
        pub(in super::super) fn new(settings: Settings) -> Self {
            let next = if io::stderr().is_terminal() { Duration::from_secs(1) } else { Duration::MAX };
            Self { settings, begun: Instant::now(), next, bar: None }
        }

        pub(in super::super) fn at(&mut self, time: f64) {
            if self.begun.elapsed() < self.next {
                return;
            }
            self.next = self.begun.elapsed() + Duration::from_millis(100);
            let bar = self.bar.get_or_insert_with(|| {
                let style = ProgressStyle::with_template("{wide_bar} {percent} %  {eta} left");
                ProgressBar::new(1000).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
            });
            let done = (time - self.settings.start) / (self.settings.stop - self.settings.start);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and 1000")]
            bar.set_position((1000.0 * done.clamp(0.0, 1.0)) as u64);
        }

        pub(in super::super) fn end(&mut self) {
            if let Some(bar) = self.bar.take() {
                bar.finish_and_clear();
            }
        }
    }
}
