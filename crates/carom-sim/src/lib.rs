//! carom-sim
