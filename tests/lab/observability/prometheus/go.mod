// Prometheus 3.2.1, whose module has the version v0.302.1. exclude and replace are Prometheus' own: those of a
// module that is depended on do not count.
module rosops.example/prometheus

go 1.24

exclude (
	github.com/grpc-ecosystem/grpc-gateway v1.14.7
	github.com/linode/linodego v1.0.0
	google.golang.org/api v0.30.0
)

replace github.com/fsnotify/fsnotify v1.8.0 => github.com/fsnotify/fsnotify v1.7.0

require github.com/prometheus/prometheus v0.302.1
