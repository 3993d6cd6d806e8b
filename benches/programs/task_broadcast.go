// task_broadcast: one broadcast to ten thousand goroutines that wait for it, a hundred times.
package main

import (
	"fmt"
	"sync"
)

func main() {
	var lock sync.Mutex
	event := sync.NewCond(&lock)
	woken, turn := 0, 0
	var waiting, done sync.WaitGroup
	done.Add(10000)
	waiting.Add(10000)
	for i := 0; i < 10000; i++ {
		go func() {
			defer done.Done()
			lock.Lock()
			defer lock.Unlock()
			for mine := 0; mine < 100; mine++ {
				waiting.Done()
				for turn == mine {
					event.Wait()
				}
				woken++
			}
		}()
	}
	for i := 0; i < 100; i++ {
		waiting.Wait()
		lock.Lock()
		if i < 99 {
			waiting.Add(10000)
		}
		turn++
		event.Broadcast()
		lock.Unlock()
	}
	done.Wait()
	fmt.Println(woken)
}
