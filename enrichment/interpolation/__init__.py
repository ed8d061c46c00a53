"""What fills the gaps between rings without learning: ray segments, and the completion of depth images."""
