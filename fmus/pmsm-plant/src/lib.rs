//! The FMU PmsmPlant.

fmu_export::export!(drive::PmsmPlant: ContinuousTime + Events + Differentiable + CompletedSteps + Warns);
