package main
import ("testing";"crypto/tls";"crypto/x509";"net/http")
func TestZ(t *testing.T){
 p, err := tls.LoadX509KeyPair("/tmp/w/k3sdev/tls/client-admin.crt","/tmp/w/k3sdev/tls/client-admin.key"); if err!=nil {t.Fatal(err)}
 ca, err := loadCA("/tmp/w/k3sdev/tls/client-ca.crt","/tmp/w/k3sdev/tls/client-ca.key"); if err!=nil {t.Fatal(err)}
 var pc []*x509.Certificate
 for _, d := range p.Certificate { c, _ := x509.ParseCertificate(d); pc = append(pc, c)}
 roots := x509.NewCertPool(); roots.AddCert(ca.cert)
 _, err = pc[0].Verify(x509.VerifyOptions{Roots: roots, KeyUsages: []x509.ExtKeyUsage{x509.ExtKeyUsageClientAuth}})
 t.Log(len(pc), err)
 s := &supervisor{cas: map[string]*authority{"client-ca":ca}}
 t.Log(s.peerUser(&http.Request{TLS:&tls.ConnectionState{PeerCertificates: pc}}))
}
