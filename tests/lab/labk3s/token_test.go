package main

import (
	"strings"
	"testing"
)

func TestToken(t *testing.T) {
	bundle := []byte("-----BEGIN CERTIFICATE-----\n")
	hash := hashCA(bundle)
	for _, test := range []struct{ given, user, wantUser, wantSecret, wantHash string }{
		{"secret", "node", "node", "secret", ""},
		{" secret\n", "server", "server", "secret", ""},
		{"K10" + hash + "::server:secret", "node", "server", "secret", hash},
		{"K10" + hash + "::node:with:colon", "server", "node", "with:colon", hash},
		{"abcdef.0123456789abcdef", "node", "", "abcdef.0123456789abcdef", ""},
		{"K10" + hash + "::abcdef.0123456789abcdef", "node", "", "abcdef.0123456789abcdef", hash},
	} {
		got, err := parseToken(test.given, test.user)
		if err != nil {
			t.Errorf("%q: %v", test.given, err)
			continue
		}
		if want := (token{test.wantHash, test.wantUser, test.wantSecret}); got != want {
			t.Errorf("%q: got %+v, want %+v", test.given, got, want)
		}
		if test.wantHash != "" && got.String() != test.given {
			t.Errorf("%q: written as %q", test.given, got)
		}
		if err := got.verifyCA(bundle); err != nil {
			t.Errorf("%q: %v", test.given, err)
		}
		if err := got.verifyCA([]byte("other")); (err != nil) != (test.wantHash != "") {
			t.Errorf("%q against another CA: %v", test.given, err)
		}
	}
	for _, bad := range []string{"", "  ", "K10abc", "K10" + hash, "K10" + hash + "::server", "K10" + hash + "::server:", "K10" + strings.Repeat("z", 64) + "::server:x"} {
		if got, err := parseToken(bad, "node"); err == nil {
			t.Errorf("%q was read as %+v", bad, got)
		}
	}
}
