;;; test.el --- What an editor sees of `esl-mode' and `eslc lsp'  -*- lexical-binding: t; -*-

;; emacs --batch -L editors/emacs -l editors/emacs/test.el FOLDER
;;
;; Opens a file in FOLDER, starts the server that `esl-command' names (the environment variable ESLC), and
;; does what one does in an editor. Ends with status 1 at the first thing that is not as it should be.

;;; Code:

(when (require 'package nil t) (package-initialize))
(require 'esl-mode)

(defun test-is (what expected found)
  (unless (equal expected found)
    (message "%s: expected %S, found %S" what expected found)
    (kill-emacs 1)))

(defun test-wait (what condition)
  "Wait until CONDITION gives something, and return it."
  (let ((end (time-add nil 60)) (found nil))
    (while (and (not (setq found (funcall condition))) (time-less-p nil end))
      (accept-process-output nil 0.05))
    (unless found
      (message "%s does not come" what)
      (kill-emacs 1))
    found))

(defun test-go (text)
  "Put point after the first TEXT."
  (goto-char (point-min))
  (search-forward text))

(defconst test-program
  "(define-cause :stuck ())
(defun drive (metres)
\"Drives so far.\"
(when (plusp metres)
(fail :stuck metres)))
(with-recovery-procedures (((:stuck metres) :retries 3
(retry)))
(drvie 5))
")

(let ((file (expand-file-name "drive.esl" (pop command-line-args-left))))
  (with-temp-file file (insert test-program))
  (find-file file))
(test-is "the mode" 'esl-mode major-mode)
(font-lock-ensure)
(test-go "(fai")
(test-is "the face of a failure" 'font-lock-warning-face (get-text-property (point) 'face))
(test-go "defun dri")
(test-is "the face of a name" 'font-lock-function-name-face (get-text-property (point) 'face))

;; The folder of the file is the project, whatever it lies in.
(setq project-find-functions nil)

;; The mode indents as the server does.
(let ((by-mode (progn (indent-region (point-min) (point-max)) (buffer-string))))
  (if (not (require 'eglot nil t))
      (message "without eglot")
    (setq esl-command (or (getenv "ESLC") esl-command))
    (setq eglot-sync-connect 60)
    (setq eglot-confirm-server-initiated-edits nil)
    (apply #'eglot (eglot--guess-contact))
    (eglot-format-buffer)
    (test-is "the indentation" (buffer-string) by-mode)

    (let ((found (test-wait "a diagnostic" #'flymake-diagnostics)))
      (test-is "the number of diagnostics" 1 (length found))
      (test-is "the diagnostic" t
               (and (string-match-p "drvie" (flymake-diagnostic-text (car found))) t)))
    (test-go "drvie")
    (let* ((found (alist-get 'eglot-lsp-diag (eglot--diag-data (car (flymake-diagnostics)))))
           (actions (jsonrpc-request
                     (eglot--current-server-or-lose) :textDocument/codeAction
                     (list :textDocument (eglot--TextDocumentIdentifier) :range (plist-get found :range)
                           :context (list :diagnostics (vector found))))))
      (test-is "the repair" t (and (string-match-p "drive" (format "%s" actions)) t)))
    (search-backward "drvie")
    (replace-match "drive")
    (eglot--signal-textDocument/didChange)
    (test-wait "the end of the diagnostic" (lambda () (null (flymake-diagnostics))))

    (test-go "(drive 5")
    (backward-char 4)
    (call-interactively #'xref-find-definitions)
    (test-is "the line of the definition" 2 (line-number-at-pos))
    (let ((hover (jsonrpc-request (eglot--current-server-or-lose) :textDocument/hover
                                  (eglot--TextDocumentPositionParams))))
      (test-is "the documentation" t (and (string-match-p "Drives so far" (format "%s" hover)) t)))
    (test-go "(drive 5")
    (insert " :x)\n(dri")
    (eglot--signal-textDocument/didChange)
    (let* ((capf (eglot-completion-at-point))
           (names (all-completions "dri" (nth 2 capf))))
      (test-is "a completion" t (and (member "drive" names) t)))
    (test-go "(retry")
    (esl-expand)
    (with-current-buffer "*ESL expansion*"
      (test-is "the expansion" t (and (string-match-p "%with-recovery" (downcase (buffer-string))) t)))
    (eglot-shutdown (eglot--current-server-or-lose))))
(set-buffer-modified-p nil)
(message "all is well")

;;; test.el ends here
