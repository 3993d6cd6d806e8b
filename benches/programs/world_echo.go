// world_echo: a server with a thousand connections, each of which asks twenty times and waits for the echo.
package main

import (
	"bufio"
	"fmt"
	"net"
)

func echo(connection net.Conn) {
	reader := bufio.NewReader(connection)
	for {
		line, err := reader.ReadString('\n')
		if err != nil {
			connection.Close()
			return
		}
		connection.Write([]byte(line))
	}
}

func main() {
	listener, _ := net.Listen("tcp", "127.0.0.1:0")
	go func() {
		for {
			connection, err := listener.Accept()
			if err != nil {
				return
			}
			go echo(connection)
		}
	}()
	answers := make(chan int)
	for i := 0; i < 1000; i++ {
		go func() {
			connection, _ := net.Dial("tcp", listener.Addr().String())
			reader := bufio.NewReader(connection)
			count := 0
			for j := 0; j < 20; j++ {
				connection.Write([]byte("hello\n"))
				line, _ := reader.ReadString('\n')
				if line == "hello\n" {
					count++
				}
			}
			connection.Close()
			answers <- count
		}()
	}
	sum := 0
	for i := 0; i < 1000; i++ {
		sum += <-answers
	}
	fmt.Println(sum)
}
