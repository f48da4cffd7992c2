//! A null record against the plant: the record's own valve commands, in windows of equal start and in one free run.
