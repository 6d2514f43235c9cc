"""Host sins against the C interface, each in its own process: crashes and hangs are results, not lost runs."""
