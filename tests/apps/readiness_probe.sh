#!/bin/sh
# Readiness by file, as in the seed: the application makes this file when it is ready and removes it when it stops.
test -f /tmp/ready
