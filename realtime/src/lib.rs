//! Time: clocks, periodic loop, priority and pinning, histograms.
