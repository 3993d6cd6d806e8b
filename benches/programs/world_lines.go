// world_lines: a million short messages, lines over a connection of the loopback.
package main

import (
	"bufio"
	"fmt"
	"net"
)

func main() {
	listener, _ := net.Listen("tcp", "127.0.0.1:0")
	go func() {
		connection, _ := net.Dial("tcp", listener.Addr().String())
		writer := bufio.NewWriter(connection)
		for i := 0; i < 1000000; i++ {
			writer.WriteString("message\n")
		}
		writer.Flush()
		connection.Close()
	}()
	connection, _ := listener.Accept()
	scanner := bufio.NewScanner(connection)
	count := 0
	for scanner.Scan() {
		_ = scanner.Text()
		count++
	}
	fmt.Println(count)
}
