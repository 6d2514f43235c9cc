//! The FMU PmsmDrive.

fmu_export::export!(drive::PmsmDrive: ContinuousTime + Events + Differentiable + CompletedSteps + Warns);
