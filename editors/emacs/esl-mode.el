;;; esl-mode.el --- Major mode for ESL, the Execution Support Language  -*- lexical-binding: t; -*-

;; Version: 0.1.0
;; Package-Requires: ((emacs "28.1"))
;; Keywords: languages, lisp

;;; Commentary:

;; A mode over `lisp-mode'.  The language server `eslc lsp' does the rest, by Eglot: M-x eglot.

;;; Code:

(require 'lisp-mode)
(require 'cl-indent)

(defgroup esl nil
  "The Execution Support Language."
  :group 'languages)

(defcustom esl-command "eslc"
  "The compiler, which is the language server too."
  :type 'string)

(defcustom esl-machine "eslvm"
  "The virtual machine, which runs tests."
  :type 'string)

(defconst esl-mode--failure-forms
  '("fail" "retry" "abort" "with-recovery-procedures" "with-cleanup-procedure" "define-cause"))

(defconst esl-mode--task-forms
  '("spawn" "task-net" "or-parallel" "try-all" "pursue" "try-in-order" "partial-order" "supervise"
    "with-guardian" "whenever" "wait-until" "with-timeout" "with-budget" "with-quota" "do-every"
    "without-interrupts" "with-resource" "with-resources" "with-maintained-property"
    "with-maintained-properties" "to-achieve" "achieve"))

(defvar esl-mode-font-lock-keywords
  `((,(concat "(" (regexp-opt esl-mode--failure-forms t) "\\_>") 1 font-lock-warning-face)
    (,(concat "(" (regexp-opt esl-mode--task-forms t) "\\_>") 1 font-lock-keyword-face)
    ("(\\(define-[a-z-]+\\|deftest\\)\\s-+(?\\([^ \t\n()]+\\)"
     (1 font-lock-keyword-face) (2 font-lock-function-name-face))
    ("#\\?\\(?:\\sw\\|\\s_\\)+" . font-lock-variable-name-face)))

(defun esl-mode--indent-recovery (path state indent-point sexp-column normal-indent)
  "Indent a part of a form with recovery clauses, whose bodies stand two columns in.
The arguments are those of `common-lisp-indent-function'."
  (if (and (eql (car path) 1) (= (length path) 3))
      (save-excursion
        (goto-char (elt state 1))
        (list (+ 2 (current-column)) (point)))
    (lisp-indent-259 '((&whole 4 &rest 1) &body) path state indent-point sexp-column normal-indent)))

;; As `eslc format' indents.
(dolist (form '((with-recovery-procedures . esl-mode--indent-recovery)
                (with-cleanup-procedure . 1) (with-timeout . 1)
                (with-budget . 1) (with-quota . 1) (with-guardian . 2) (with-resource . 1)
                (with-resources . 1) (with-maintained-property . 1) (with-maintained-properties . 1)
                (with-world . 1) (with-query-bindings . 1) (to-achieve . 1) (whenever . 1) (do-every . 1)
                (supervise . 1) (partial-order . 1) (task-net . 0) (or-parallel . 0) (try-all . 0)
                (pursue . 0) (try-in-order . 0) (spawn . 0) (without-interrupts . 0)
                (with-automatic-recoveries . 0) (fails . 1) (signals . 1)))
  (unless (get (car form) 'common-lisp-indent-function)
    (put (car form) 'common-lisp-indent-function (cdr form))))

(defun esl-expand ()
  "Show the top-level form at point with its macros expanded."
  (interactive)
  (require 'eglot)
  (let* ((server (eglot-current-server))
         (text (if server
                   (eglot-execute-command server "esl.expand"
                                          (vector (eglot--TextDocumentPositionParams)))
                 (user-error "No server: M-x eglot"))))
    (with-current-buffer (get-buffer-create "*ESL expansion*")
      (let ((inhibit-read-only t))
        (erase-buffer)
        (insert text))
      (esl-mode)
      (view-mode 1)
      (display-buffer (current-buffer)))))

(defun esl-run-test ()
  "Run the test around point by `eslvm test'."
  (interactive)
  (save-buffer)
  (save-excursion
    (end-of-line)
    (beginning-of-defun)
    (if (looking-at "(deftest\\s-+\\([^ \t\n()]+\\)")
        (compile (format "%s test %s --filter %s" (shell-quote-argument esl-machine)
                         (shell-quote-argument (buffer-file-name))
                         (shell-quote-argument (match-string-no-properties 1))))
      (user-error "Point is not in a `deftest'"))))

(defvar esl-mode-map
  (let ((map (make-sparse-keymap)))
    (set-keymap-parent map lisp-mode-shared-map)
    (define-key map (kbd "C-c C-e") #'esl-expand)
    (define-key map (kbd "C-c C-t") #'esl-run-test)
    map)
  "Keys of `esl-mode'.")

;;;###autoload
(define-derived-mode esl-mode lisp-mode "ESL"
  "Major mode for programs in ESL, the Execution Support Language."
  (setq-local indent-tabs-mode nil)
  (setq-local lisp-indent-function #'common-lisp-indent-function)
  (setq-local inferior-lisp-program "eslvm repl")
  (font-lock-add-keywords nil esl-mode-font-lock-keywords))

;;;###autoload
(add-to-list 'auto-mode-alist '("\\.esl\\'" . esl-mode))

(with-eval-after-load 'eglot
  (add-to-list 'eglot-server-programs
               `(esl-mode . ,(lambda (&rest _) (list esl-command "lsp")))))

(provide 'esl-mode)

;;; esl-mode.el ends here
