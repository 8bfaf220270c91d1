package main

import (
	"fmt"
	"os"
	"time"
)

// logf writes k3s's log format, which is what people grep for in its journal.
func logf(level, format string, args ...any) {
	fmt.Fprintf(os.Stderr, "time=%q level=%s msg=%q\n", time.Now().UTC().Format(time.RFC3339), level, fmt.Sprintf(format, args...))
}
