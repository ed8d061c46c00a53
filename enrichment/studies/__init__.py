"""The paper's two studies: what sparse frequencies keep of a depth image, and what image edges say of depth."""
