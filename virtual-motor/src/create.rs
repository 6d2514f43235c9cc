//! A motor from a motor file, or from a preset of `PmsmPlant`.

use crate::error::{Error, ErrorCode, Result};
use crate::motor::VirtualMotor;
use crate::variables;
use drive_tools::tune::motor::MotorFile;
use drive_tools::tune::rules;
use fmu_core::preset::{self, PresetValue};
use std::path::Path;

/// Name of a motor file that is given as a text, for messages.
const TEXT: &str = "motor file";

impl VirtualMotor {
    /// The motor of the motor file at this path.
    ///
    /// # Errors
    /// States the line and column of what is wrong in the file.
    pub fn from_motor_file(path: &Path) -> Result<Self> {
        MotorFile::read(path).map_err(wrong).and_then(|file| of(&file))
    }

    /// The motor of the motor file with this text. A flux map that it names is in the current folder.
    ///
    /// # Errors
    /// States the line and column of what is wrong in the text.
    pub fn from_motor_text(text: &str) -> Result<Self> {
        MotorFile::parse(text, Path::new(TEXT)).map_err(wrong).and_then(|file| of(&file))
    }

    /// The motor of a preset: the text of `resources/fmu-preset.json` of an archive of `PmsmPlant`, or the same JSON with any start
    /// values.
    ///
    /// # Errors
    /// The text is not a preset, or a name or a value is not allowed.
    pub fn from_preset(json: &str) -> Result<Self> {
        let values = preset::read(json.as_bytes()).map_err(|fault| wrong(format_args!("the preset {fault}")))?;
        let (mut motor, mut set) = (Self::default(), Vec::new());
        for PresetValue { name, value } in &values {
            let of_name = |error: Error| wrong(format_args!("the preset: {error}"));
            let variable = variables::find(name).map_err(of_name)?;
            if set.contains(&variable) {
                return Err(wrong(format_args!("the preset: {name} already has a value")));
            }
            set.push(variable);
            motor.set(variable, number(name, value)?).map_err(of_name)?;
        }
        motor.settle_start_values(values.iter().any(|value| value.name == "inverter.mode"));
        Ok(motor)
    }
}

fn of(file: &MotorFile) -> Result<VirtualMotor> {
    let block = rules::plant_of(file).map_err(|error| wrong(format_args!("{error:#}")))?;
    Ok(VirtualMotor::with(block, *file.data.rating.current.get_ref()))
}

fn number(name: &str, value: &str) -> Result<f64> {
    match value {
        "true" => Ok(1.0),
        "false" => Ok(0.0),
        _ => value.parse().map_err(|_| wrong(format_args!("the preset: {name} = {value:?} is not allowed: a number"))),
    }
}

fn wrong(text: impl std::fmt::Display) -> Error {
    Error::new(ErrorCode::BadFile, text)
}
