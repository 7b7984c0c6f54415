"""Values that everything else speaks in: recordings, waveform tables, motions, events, errors."""
