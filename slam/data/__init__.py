"""Ground floor: clouds, poses, sensors and the data sets they come from. Imports nothing else of ours."""
