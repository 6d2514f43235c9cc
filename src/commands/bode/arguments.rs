//! The options of `fmu bode`.

use super::coupling::Train;
use super::loops::Loop;
use cargo_fmu::system::{SteppingOptions, SystemOptions};
use cargo_fmu::worker::ProcessOptions;
use clap::Args;
use std::path::PathBuf;

/// Measures frequency responses of running FMUs by a swept sine, with the sampled controller in them.
///
/// A sine is added to the input --from. At each frequency a run reaches the operating point of --set and --input within --settle,
/// then whole periods are measured until two agree; the response is --to over the sine, or over the variable --over. A second run at
/// half the amplitude and a third one at half the communication step check and correct the value: warnings name the frequencies at
/// which the system is not linear, has not settled or needs a shorter --step.
///
/// --closed and --open say that the response is a closed loop T or an open loop L; T / (1 - T) = L. The command prints bandwidth,
/// peak, crossover, gain and phase margin, and the largest sensitivity, between the frequencies measured.
///
/// The FMUs run in a separate process with limits, as those of fmu simulate: one that crashes or blocks ends the measurement with an
/// error. Ctrl-C ends it after the frequencies under way, a second Ctrl-C at once.
///
/// --loop selects input and outputs of PmsmDrive and of FMUs with its variables, in steps of the controller's sample period.
///
/// The speed loop of the drive at 1000 rpm, with margins, on a page:
///   fmu bode target/fmu/fmi3/PmsmDrive.fmu --loop speed --input speed_ref=0:0,0.1:1000rpm --settle 2 --html speed.html
/// The response of any FMU, at 20 frequencies between 1 Hz and 1 kHz:
///   fmu bode RcCircuit.fmu --from u --to u_c --frequencies 1:1000:20 --step 1e-4 --csv rc.csv
/// What --loop current measures:
///   fmu bode PmsmDrive.fmu --from speed_ref --to i_q_est --over i_q_ref --closed --step 1e-4 --set controller.estimator=Sensored
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub struct Bode {
    /// FMUs and values.
    #[command(flatten)]
    pub system: SystemOptions,
    /// Stepping.
    #[command(flatten)]
    pub stepping: SteppingOptions,
    /// A response of a drive
    #[arg(long = "loop", value_enum, required_unless_present_all = ["from", "to"], conflicts_with_all = ["from", "to", "over", "closed", "open"])]
    pub which: Option<Loop>,
    /// The input, or tunable parameter, that gets the sine
    #[arg(long, value_name = "INPUT", requires = "to")]
    pub from: Option<String>,
    /// The variable that responds
    #[arg(long, value_name = "VARIABLE", requires = "from")]
    pub to: Option<String>,
    /// The variable whose response is the reference, instead of the input
    #[arg(long, value_name = "VARIABLE")]
    pub over: Option<String>,
    /// The response is a closed loop: report the open one, T / (1 - T), with its margins
    #[arg(long, conflicts_with = "open")]
    pub closed: bool,
    /// The response is an open loop, with the feedback -L: report its margins
    #[arg(long)]
    pub open: bool,
    /// With --loop impedance: a load behind a spring, its stiffness in N.m/rad, damping in N.m.s/rad and inertia in kg.m2; prints the
    /// longest communication step for a compliant shaft
    #[arg(long, value_name = "C,D,J", requires = "which")]
    pub spring: Option<Train>,
    /// Frequencies in Hz: a list, or FIRST:LAST:COUNT, evenly in the logarithm [default: 10 a decade, from 2e-4 / step to 0.2 / step,
    /// and more where the response bends]
    #[arg(long, value_name = "HZ,...|HZ:HZ:N", allow_hyphen_values = true)]
    pub frequencies: Option<String>,
    /// Amplitude of the sine in the unit of the input [default: a hundredth of the input's size, reduced until the FMU is linear]
    #[arg(long, value_name = "A", allow_negative_numbers = true)]
    pub amplitude: Option<f64>,
    /// Time in s from the start to the operating point [default: the duration of the FMUs' default experiment, else 1]
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub settle: Option<f64>,
    /// Communication step in s, preferably the sample period of a controller; high frequencies use fractions of it [default:
    /// with --loop controller.T_s, else the shortest of the FMUs, else a thousandth of the settling time]
    #[arg(long, value_name = "H", allow_negative_numbers = true)]
    pub step: Option<f64>,
    /// Threads [default: all cores]
    #[arg(long, value_name = "N", overrides_with = "jobs", value_parser = clap::value_parser!(u16).range(1..))]
    pub jobs: Option<u16>,
    /// Write the responses as CSV; - for standard output
    #[arg(long, value_name = "FILE|-")]
    pub csv: Option<PathBuf>,
    /// Write the Bode plot; the extension selects the format
    #[arg(long, value_name = "FILE.svg|FILE.png")]
    pub plot: Option<PathBuf>,
    /// Write the plot as an offline page with zoom and values at the cursor
    #[arg(long, value_name = "FILE.html")]
    pub html: Option<PathBuf>,
    /// The process of the FMUs.
    #[command(flatten)]
    pub process: ProcessOptions,
}
