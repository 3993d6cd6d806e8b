// world_operations: a hundred thousand calls of another goroutine that answers at once.
package main

import "fmt"

func main() {
	ask, answer := make(chan int), make(chan int)
	go func() {
		for n := range ask {
			answer <- n
		}
	}()
	count := 0
	for i := 0; i < 100000; i++ {
		ask <- i
		<-answer
		count++
	}
	fmt.Println(count)
}
