"""ROS's own definitions: message types (`definitions`, `sources`), names and remappings (`names`), calls of services
and actions (`calls`), bags (`bags`), listings of a running graph (`listing`), launch files (`launch`); and a system
drafted from them (`drafting`). Nothing here needs or starts an installed ROS."""
