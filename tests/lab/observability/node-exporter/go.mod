module rosops.example/node-exporter

go 1.24

require github.com/prometheus/node_exporter v1.9.1
