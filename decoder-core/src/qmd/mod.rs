//! QMD.
