"""Messages and services of the contract: made from proto/cosim/v1 by make_stubs.sh."""
