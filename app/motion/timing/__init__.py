"""When the tool is where on its path: time parameterisation, sampled references, torques asked for."""
