//! carom-study
