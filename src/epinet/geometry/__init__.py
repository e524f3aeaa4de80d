"""From a disparity map and a camera to depth in mm, point clouds and meshes."""
