"""HTTP with the service: connections and errors (`connection`), and observations as request bodies (`encoding`)."""
