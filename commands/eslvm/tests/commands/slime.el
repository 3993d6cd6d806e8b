;;; A session of SLIME in an Emacs without a screen, driven by its own commands. It says what is wrong and
;;; ends with status 1, or prints "done".

(require 'slime)
(require 'cl-lib)
(require 'ring)
;; SLIME 2.27 uses this variable, which Emacs 28 has no more.
(defvar find-tag-marker-ring (make-ring 16))
(setq slime-protocol-version "2.27"
      slime-kill-without-query-p t
      slime-enable-evaluate-in-emacs nil
      slime-log-events t)
(add-to-list 'auto-mode-alist '("\\.esl\\'" . lisp-mode))
(slime-setup '(slime-fancy))

(defun esl-wait (what predicate)
  "Waits for the run until PREDICATE returns true, and returns that."
  (let ((end (+ (float-time) 60)) (value nil))
    (while (and (not (setq value (funcall predicate))) (< (float-time) end))
      (accept-process-output nil 0.05))
    (or value (error "Waited in vain for %s" what))))

(defun esl-check (what expected found)
  (unless (equal expected found)
    (error "%s: expected %S, found %S" what expected found)))

(defun esl-search (what text buffer)
  "Waits until TEXT is in BUFFER."
  (esl-wait (format "%s in %s" what buffer)
            (lambda ()
              (and (get-buffer buffer)
                   (with-current-buffer buffer
                     (save-excursion (goto-char (point-min)) (search-forward text nil t)))))))

(defun esl-debugger ()
  "Waits for a buffer of the debugger, and returns it."
  (esl-wait "a debugger" (lambda () (car (sldb-buffers)))))

(defun esl-drive ()
  ;; Connect, with the secret of ~/.slime-secret.
  (slime-connect "127.0.0.1" (string-to-number (getenv "ESL_PORT")))
  (esl-wait "the connection" (lambda () (ignore-errors (slime-connected-p))))
  (esl-wait "the prompt" (lambda () (ignore-errors (slime-output-buffer))))
  (esl-wait "the name" (lambda () (equal "ESL" (slime-lisp-implementation-type))))
  ;; The REPL.
  (with-current-buffer (slime-output-buffer)
    (esl-wait "the prompt" (lambda () (save-excursion (goto-char (point-min))
                                                      (search-forward "ESL-USER> " nil t))))
    (goto-char (point-max))
    (insert "(list (drive 2) 'x)")
    (slime-repl-return)
    (esl-search "the value" "(6 X)" (current-buffer)))
  ;; Evaluate, complete, parameters, expand, describe.
  (esl-check "eval" "=> 6" (slime-eval '(swank:interactive-eval "(drive 2)")))
  (esl-check "complete" '("drive") (slime-simple-completions "dri"))
  (esl-check "fuzzy" "drive" (caaar (slime-fuzzy-completions "dri")))
  (esl-check "parameters" "(drive n)" (slime-eval '(swank:operator-arglist "drive" "ESL-USER")))
  (with-temp-buffer
    (lisp-mode)
    (slime-mode 1)
    (insert "(drive ")
    ;; The answer comes later, and is kept.
    (esl-wait "autodoc" (lambda () (equal "(drive n)" (substring-no-properties (or (slime-autodoc) ""))))))
  (slime-eval-macroexpand 'swank:swank-macroexpand-1 "(twice 1)")
  (esl-search "the expansion" "(list 1 1)" "*slime-macroexpansion*")
  (slime-describe-symbol "drive")
  (esl-search "the description" "Drives N." "*slime-description*")
  ;; The definition.
  (slime-edit-definition "drive")
  (esl-check "definition" "(defun drive (n)" (buffer-substring (line-beginning-position) (line-end-position)))
  ;; Redefine it in its buffer, and compile that.
  (let ((inhibit-read-only t))
    (search-forward "(* n *speed*)")
    (replace-match "(list :from-emacs n)" t t))
  (slime-compile-defun)
  (esl-wait "the new function"
            (lambda () (equal "=> (:FROM-EMACS 7)" (slime-eval '(swank:interactive-eval "(drive 7)")))))
  (set-buffer-modified-p nil)
  ;; A mistake is shown where it is.
  (goto-char (point-max))
  (insert "\n(defun wrong (n) (if))")
  (slime-compile-defun)
  (esl-wait "the note" (lambda () (ignore-errors (slime-compiler-notes))))
  (esl-check "severity" :error (plist-get (car (slime-compiler-notes)) :severity))
  (set-buffer-modified-p nil)
  ;; The inspector.
  (slime-inspect "(make-wheel :size 4)")
  (esl-search "the slot" "size: 4" "*slime-inspector*")
  (with-current-buffer "*slime-inspector*"
    (slime-inspector-quit))
  ;; A task of the program fails; it is given a value.
  (slime-eval-async '(swank:interactive-eval "(signal *go*)"))
  (with-current-buffer (esl-debugger)
    (esl-search "the failure" "A failure of cause :STUCK with 5." (current-buffer))
    (esl-search "the frame" "STUMBLE at" (current-buffer))
    (cl-letf (((symbol-function 'read-from-minibuffer) (lambda (&rest _) "6"))
              ((symbol-function 'slime-read-from-minibuffer) (lambda (&rest _) "6")))
      (sldb-invoke-restart 0)
      (esl-wait "its end" (lambda () (null (sldb-buffers))))
      ;; It asks for the value, and goes on with it.
      (esl-wait "the worker"
                (lambda () (equal "=> 7" (slime-eval '(swank:interactive-eval "*got*")))))))
  ;; A failure of what is evaluated: back to the prompt.
  (with-current-buffer (slime-output-buffer)
    (goto-char (point-max))
    (insert "(car 1)")
    (slime-repl-return))
  (with-current-buffer (esl-debugger)
    (sldb-quit))
  (esl-wait "its end" (lambda () (null (sldb-buffers))))
  (esl-search "the abort" "; Evaluation aborted on" (slime-output-buffer))
  ;; Tasks.
  (slime-list-threads)
  (esl-search "a task" "IDLER" "*slime-threads*")
  (with-current-buffer "*slime-threads*"
    (goto-char (point-min))
    (search-forward "IDLER")
    (slime-thread-kill)
    (esl-wait "the end of a task"
              (lambda () (equal "=> NIL" (slime-eval '(swank:interactive-eval
                                                       "(find 'idler (list-tasks) :key #'task-name)"))))))
  (slime-disconnect)
  (princ "done\n"))

(condition-case problem
    (esl-drive)
  (error (message "%s" (error-message-string problem))
         (when (get-buffer "*slime-events*")
           (with-current-buffer "*slime-events*" (message "%s" (buffer-string))))
         (kill-emacs 1)))
