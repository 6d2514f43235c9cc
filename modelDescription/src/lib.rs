//! modelDescription.xml, written and read.
