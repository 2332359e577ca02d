"""What ROS itself defines: message types (`definitions`, `sources`), names and remappings (`names`), calls of services
and actions (`calls`), bags (`bags`), listings of a running graph (`listing`), launch files (`launch`); and a system
drafted from them (`drafting`). Nothing here needs an installed ROS, and nothing here starts one."""
