"""A case made from any scene: what can be asked of the codes is found from the scene and from its runs."""
