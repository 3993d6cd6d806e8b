// world_pending: a hundred thousand goroutines, each waiting for a message that does not come.
package main

import "fmt"

func main() {
	begun, never := make(chan bool), make(chan bool)
	for i := 0; i < 100000; i++ {
		go func() {
			begun <- true
			<-never
		}()
	}
	for i := 0; i < 100000; i++ {
		<-begun
	}
	fmt.Println(100000)
}
