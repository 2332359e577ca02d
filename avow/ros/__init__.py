"""What ROS itself defines: message types (`definitions`, `sources`), names and remappings (`names`), launch files
(`launch`). Nothing here needs an installed ROS, and nothing here starts one."""
