"""First model of a thing: RGB-D images from known poses, fused to a coloured mesh, refined by rendering."""
