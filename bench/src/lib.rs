//! Everything around plant and controller: run summaries and pictures.
