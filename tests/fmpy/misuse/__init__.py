"""Host sins against the C interface, each in a process of its own: crashes and hangs are results, not lost runs."""
