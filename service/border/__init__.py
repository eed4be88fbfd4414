"""What stands between the network and the routes: who may ask, by which name, in which way."""
