#!/bin/sh
# Readiness by file, as in the seed: the application makes READY_FILE when it is ready and removes it when it stops.
test -f "${READY_FILE:-/tmp/ready}"
