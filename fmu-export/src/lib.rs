//! The C interfaces of FMI 2.0 and FMI 3.0.
