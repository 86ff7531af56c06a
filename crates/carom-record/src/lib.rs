//! carom-record
