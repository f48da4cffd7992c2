//! Whole-system tests: processes, buses, third-party clients.
